"""`descentflow simulate --plant`: its words, its help, its errors, and what it writes."""

from pathlib import Path

import polars as pl
import pytest

from descentflow.cli import main
from descentflow.cli.simulate_command import planted
from descentflow.core.errors import ConfigError
from descentflow.simulation.plantable import PLANTABLE


@pytest.mark.parametrize(
    "word",
    [
        "temperature:deviation_k",
        "temperature:deviation_k=10,deviation_k=12",
        "temperature=10",
    ],
)
def test_words_that_are_none_are_refused(word: str) -> None:
    with pytest.raises(ConfigError, match=r"--plant .*expected .*=(NUMBER|VALUE)"):
        planted([word])


def test_an_effect_comes_once() -> None:
    with pytest.raises(ConfigError, match="each effect once"):
        planted(["mass", "mass:factor=1.1"])


def test_help_lists_every_effect_with_its_values_units_and_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    text = capsys.readouterr().out
    for name, effect in PLANTABLE.items():
        assert f"  {name}: {effect.description}\n" in text
        assert all(value.text in text for value in effect.values)
    assert "deviation_k=10 [K] mean deviation" in text


def test_planted_flights_say_so_and_mistakes_end_with_a_message(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = tmp_path / "rows.parquet"
    plant = ["--plant", "vertical_rate_lag:lag_s=8", "--plant", "mass:factor=1.05,share=0.5"]
    assert main(["simulate", "--flights", "6", "--out", str(rows), *plant]) == 0
    said = capsys.readouterr().out
    assert "planted: vertical_rate_lag (lag_s=8, spread_s=0), mass (factor=1.05, spread=0, share=0.5)" in said
    flights = pl.read_parquet(tmp_path / "rows_flights.parquet")
    assert flights["planted_vertical_rate_lag_lag_s"].to_list() == [8.0] * 6
    assert set(flights["planted_mass_factor"].to_list()) <= {1.05, None}
    for word, message in (
        ("warmth", "to plant warmth; expected one of temperature"),
        ("mass:kilograms=3", "mass with kilograms; expected of mass: factor=0.9 mean factor"),
        ("mass:share=2", "share=2; expected a finite number, at least 0 and at most 1"),
    ):
        assert main(["simulate", "--out", str(rows), "--plant", word]) == 2
        assert message in capsys.readouterr().err
