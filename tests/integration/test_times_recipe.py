"""The page's recipe for times of so6: of the model's own flights no difference, numbers that come again included."""

import re
import shutil
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path

import polars as pl
import pytest

import descentflow as df

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "times_of_points.md"


def so6(flights: list[list[tuple[datetime, int]]], numbers: list[int]) -> str:
    """Segments between points (time, level) of each flight."""
    return "".join(
        f"P_Q EGLL LFPG A320 {t:%H%M%S} {u:%H%M%S} {high} {low} 1 CS{number} {t:%y%m%d} {u:%y%m%d} 1 2 3 4 {number} "
        f"{place} 4.071 0\n"
        for points, number in zip(flights, numbers, strict=True)
        for place, ((t, high), (u, low)) in enumerate(pairwise(points), 1)
    )


def test_the_recipe_gives_the_times_of_the_flights(
    a320: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    levels = df.sample(a320, 80, seed=5).to_polars().filter(pl.col("level_fl") % 10 == 0).sort("sample_id", "time_s")
    flights = [
        [
            (datetime(2026, 3, 1 + number % 20, 23, 55, tzinfo=UTC) + timedelta(seconds=s), fl)
            for s, fl in flight.select(pl.col("time_s").round(), "level_fl").rows()
        ]
        for number, flight in enumerate(levels.partition_by("sample_id", maintain_order=True))
    ]
    begin, level = flights[0][0]
    stopping = [(begin, level), (begin + timedelta(minutes=5), 230), (begin + timedelta(minutes=25), 230)]
    stopping.append((begin + timedelta(minutes=27), 200))
    # Four numbers, each of a flight a day.
    numbers = [1 + number // 20 for number in range(len(flights))]
    (tmp_path / "20260301.m3.so6").write_text(so6([*flights, stopping], [*numbers, 99]))
    shutil.copy(a320, tmp_path / "best.ckpt")
    monkeypatch.chdir(tmp_path)
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
    names: dict = {}
    exec(compile(code.replace("n=10_000", "n=1000"), str(PAGE), "exec"), names)
    own = [{fl: t for t, fl in flight} for flight in flights]
    seconds = [(flight[200] - flight[250]).total_seconds() for flight in own if 200 in flight and 250 in flight]
    assert sorted(names["real"].to_list()) == pytest.approx(sorted(seconds))
    assert len(seconds) > 70
    assert float(re.findall(r"p-value (\S+)", capsys.readouterr().out)[0]) > 0.001
