"""The page of plots shows every rule at work, the same flights whatever the partitions."""

import json
from pathlib import Path

import polars as pl
import pytest
from polars.testing import assert_frame_equal
from surveillance_toys import fleet, written

from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows.drop_report import SHOWN_COLUMNS as SHOWN
from descentflow.surveillance.rows.drop_report import some_flights


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = pl.int_range(pl.len())
    rows = fleet(6).with_columns(
        altitude=pl.when(at % 397 == 50).then(pl.col("altitude") + 4000).otherwise("altitude"),
        Mach=pl.when(at % 101 == 7).then(pl.col("Mach") * 0.8).otherwise("Mach"),
    )
    return written(rows, tmp_path_factory.mktemp("rows") / "rows.parquet")


def test_dropped_rows_account_for_every_row_and_do_not_depend_on_partitions(path: Path, tmp_path: Path) -> None:
    whole = prepare([path], shown=100, out=tmp_path / "a.parquet")
    assert whole.dropped_rows is not None
    assert whole.dropped_rows.columns == [*SHOWN, "reason"]
    counts = dict(whole.dropped_rows["reason"].value_counts().iter_rows())
    after = whole.report.steps[[step.step for step in whole.report.steps].index("flights_separated") :]
    assert {step.step: step.rows_dropped for step in after if step.rows_dropped} == {
        k: v for k, v in counts.items() if k
    }
    assert counts[None] == after[-1].rows_left
    few = [
        prepare([path], shown=2, out=tmp_path / f"{memory}.parquet", memory_bytes=memory, workers=2)
        for memory in (10**9, 500_000)
    ]
    frames = [
        prepared.dropped_rows.sort("flight_id", "timestamp") for prepared in few if prepared.dropped_rows is not None
    ]
    assert_frame_equal(*frames)
    assert_frame_equal(frames[0], some_flights(whole.dropped_rows, 2).sort("flight_id", "timestamp"))
    assert frames[0]["flight_id"].n_unique() < whole.dropped_rows["flight_id"].n_unique()


def test_a_page_is_written_whole_and_names_every_rule(path: Path, tmp_path: Path) -> None:
    folder, report = tmp_path / "figures", tmp_path / "r.json"
    words = ["prepare", str(path), "--out", str(tmp_path / "s"), "--figures", str(folder), "--report", str(report)]
    assert main(words) == 0
    page = (folder / "index.html").read_text()
    pictures = sorted(p.name for p in folder.iterdir() if p.suffix == ".png")
    assert pictures
    assert all(f'src="{name}"' in page for name in pictures)
    assert all((folder / name).read_bytes().startswith(b"\x89PNG") for name in pictures)
    assert {p.name for p in folder.iterdir()} == {"index.html", *pictures}
    for step in json.loads(report.read_text())["report"]["steps"]:
        if step["rows_dropped"] and step["flights_left"] is not None:
            assert step["step"].replace("_", " ") in page
    # The store is finished: there is nothing left to be shown.
    assert main(words) == 2
    with pytest.raises(ConfigError, match="shown while they are cleaned"):
        prepare([path], shown=1, out=tmp_path / "s")
