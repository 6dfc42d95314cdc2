"""Qualification of simulators that differ from real flights by known amounts: deviations, verdicts, record and page."""

import json
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import gap_toys
import jsonschema
import numpy as np
import polars as pl
import pytest

from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.diagnosis.gap.costs import flown
from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
from descentflow.diagnosis.sides.measured_sides import both_sides
from descentflow.diagnosis.sides.two_sides import Compared, compare
from descentflow.effects import EFFECTS
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.qualification._predicted_times import flown_as_predicted
from descentflow.qualification.deviations import BAND_FL, Numbers, by_level, of_predictions, own_predictions
from descentflow.qualification.qualification_report import Qualification
from descentflow.qualification.qualify import qualify
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents

module = import_module("descentflow.qualification.qualify")
FASTER = 1.2
"""Rate of the simulator over that of the very same real flights."""


@pytest.fixture(scope="module", autouse=True)
def few_effects() -> Iterator[None]:
    """Causes that are sought quickly: their search has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "EFFECTS", {name: EFFECTS[name] for name in ("drag_polar", "temperature")})
        yield


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return gap_toys.flights(tmp_path_factory.mktemp("qualify"), 120, 1)


@pytest.fixture(scope="module")
def faster(real: Path) -> Descents:
    """The same flights, a fifth faster down at the same airspeeds."""
    descents = read_descents(real)
    frame = descents.frame.with_columns(
        pl.col("time_s") / FASTER, pl.col("vertical_rate") * FASTER, pl.format("sim {}", "flight_id").alias("flight_id")
    )
    return Descents(frame, descents.metadata)


@pytest.fixture(scope="module")
def compared(real: Path, faster: Descents) -> Compared:
    opened = Inputs(real, faster).open()
    sides = both_sides(opened.simulator, opened.frame, CHANNELS, BAND_FL)
    return compare(sides.simulated, sides.real, opened.simulator.aircraft)


@pytest.fixture(scope="module")
def record(real: Path, faster: Descents, tmp_path_factory: pytest.TempPathFactory) -> tuple[Qualification, Path]:
    folder = tmp_path_factory.mktemp("record")
    return qualify(real, faster, out=folder), folder


def apart(compared: Compared, deviations: Numbers) -> float:
    """Mean of the real flights minus that of the simulator's."""
    real = compared.real.numpy()
    return float(np.nanmean(deviations[real]) - np.nanmean(deviations[~real]))


def test_rates_deviate_by_the_known_share_and_airspeeds_by_nothing(compared: Compared) -> None:
    """Exact but for half a percent of single flights whose extremes are drawn in."""
    rows = by_level(compared, compared.y)
    for row in rows:
        if row.quantity == "airspeed":
            assert apart(compared, row.of_flights) == pytest.approx(0.0, abs=1e-9)
        elif row is not rows[-1]:
            assert apart(compared, row.of_flights) / row.simulator == pytest.approx(1 / FASTER - 1, abs=0.005)


def test_predictions_err_by_the_known_share_of_the_time(compared: Compared) -> None:
    """Every flight needs a fifth more time than the simulator predicts, on average, and as much more distance."""
    rows = {(row.quantity, row.minutes): row for row in of_predictions(compared, compared.y, [5.0, 60.0])}
    assert apart(compared, rows[("time_ahead", 5.0)].of_flights) == pytest.approx((FASTER - 1) * 300.0, rel=0.03)
    assert apart(compared, rows[("altitude_ahead", 5.0)].of_flights) > 0
    assert np.isnan(rows[("time_ahead", 60.0)].of_flights).all()
    further = rows[("top_of_descent", None)].of_flights
    flown_nm = flown(compared, compared.y)["ground_distance"][~compared.real]
    whole = np.isfinite(further[~compared.real.numpy()])
    assert apart(compared, further) == pytest.approx((FASTER - 1) * float(flown_nm[whole].nansum(1).mean()), rel=0.05)


def test_the_record_is_outside_by_the_rate_and_names_the_limit(record: tuple[Qualification, Path]) -> None:
    judged, _ = record
    outside = {row.quantity for row in judged.rows if row.verdict == "outside"}
    assert judged.verdict == "outside"
    assert outside == {"rate"}
    assert "1.d.4" in judged.source
    assert str(judged).startswith("The simulator is outside the limits of part60, by 120 real A320 flights.")
    assert judged.to_polars()["share_inside"].is_between(0.0, 1.0).all()


def test_a_corrected_simulator_would_be_nearer(record: tuple[Qualification, Path]) -> None:
    judged, _ = record
    (whole,) = [row for row in judged.rows if row.quantity == "rate"][-1:]
    assert judged.gap.causes
    assert whole.difference is not None
    assert whole.corrected is not None
    assert abs(whole.corrected.estimate) < 0.5 * abs(whole.difference.estimate)


def test_the_files_hold_the_record(record: tuple[Qualification, Path]) -> None:
    judged, folder = record
    content = json.loads((folder / "qualification.json").read_text())
    schema = json.loads((Path(module.__file__ or "").parent / "qualification.schema.json").read_text())
    jsonschema.validate(content, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(content | {"verdict": "fine"}, schema)
    assert content["verdict"] == judged.verdict
    assert len(content["rows"]) == len(judged.rows)
    assert content["pedigree"]["real"]["fingerprint"]
    page = (folder / "qualification.html").read_text()
    for said in ("It replaces no flight test", "NASA-STD-7009", "signature", "14 CFR Part 60"):
        assert said in page


def test_flights_of_the_same_world_are_not_outside(real: Path, tmp_path: Path) -> None:
    other = gap_toys.flights(tmp_path, 150, 5)
    assert qualify(real, other).verdict in ("inside", "not enough flights")


def test_a_checkpoint_is_judged_by_its_samples(real: Path, tmp_path: Path) -> None:
    model = gap_toys.simulator(tmp_path, gap_toys.flights(tmp_path, 150, 6))
    qualification = qualify(real, model, samples=300)
    assert {row.quantity for row in qualification.rows} == {"airspeed", "rate"}
    assert qualification.independence.startswith("The checkpoint names")


def test_the_command_judges_a_type_by_limits_of_ones_own(
    real: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "ours.yaml").write_text("source: test 7\nlimits:\n- {quantity: rate, absolute: 5000}\n")
    words = ["qualify", "--real", str(real), "--typecode", "A320", "--limits", str(tmp_path / "ours.yaml")]
    assert main([*words, "--out", str(tmp_path / "record")]) == 0
    assert "Nominal BADA of the A320 is inside the limits of ours" in capsys.readouterr().out


@pytest.fixture(scope="module")
def predicted(real: Path) -> pl.DataFrame:
    """Times every ten levels, a fifth shorter than each flight will need; and those of an unknown flight."""
    frame = read_descents(real).frame.filter(pl.col("level_fl") % 10 == 0)
    times = frame.select("flight_id", "level_fl", time_s=9e4 + pl.col("time_s") / FASTER)
    return pl.concat([times, times.head(3).with_columns(flight_id=pl.lit("another"))])


def test_a_table_of_times_is_judged_flight_by_flight(real: Path, predicted: pl.DataFrame, tmp_path: Path) -> None:
    """Times, as the error is the same share of each flight's own, scatter less than flights do."""
    (tmp_path / "ours.yaml").write_text("limits:\n- {quantity: time_ahead, minutes: 5, absolute: 90}\n")
    predicted.write_csv(tmp_path / "times.csv")
    qualification = qualify(real, tmp_path / "times.csv", limits=tmp_path / "ours.yaml")
    (row,) = qualification.rows
    assert row.difference is not None
    assert row.difference.estimate == pytest.approx((FASTER - 1) * 300.0, rel=0.03)
    assert row.verdict == "inside"
    assert qualification.gap.dropped["predictions_of_other_flights"] == 1
    assert "times.csv is inside the limits of ours" in str(qualification).lower()
    assert "airspeed" not in {row.quantity for row in qualify(real, predicted).rows}


def test_each_flights_own_prediction_is_its_claim(real: Path, predicted: pl.DataFrame) -> None:
    descents = read_descents(real)
    flown_so, _ = flown_as_predicted(descents, predicted)
    opened = Inputs(descents, flown_so).open()
    sides = both_sides(opened.simulator, opened.frame, CHANNELS, BAND_FL)
    own = own_predictions(sides)
    both = compare(sides.simulated, sides.real, opened.simulator.aircraft)
    by_name, by_mean = (
        {row.quantity: row.of_flights for row in of_predictions(both, both.y, [5.0], pairs)} for pairs in (own, None)
    )
    late = by_name["time_ahead"]
    assert np.nanmax(np.abs(late[~both.real.numpy()])) == pytest.approx(0.0, abs=1e-9)
    assert np.nanstd(late[both.real.numpy()]) < 0.5 * np.nanstd(by_mean["time_ahead"][both.real.numpy()])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (pl.col("time_s") * -1.0, "do_not_grow_downwards"),
        (pl.lit(None, dtype=pl.Float64), "without_a_number"),
        (pl.lit(float("nan")), "without_a_number"),
    ],
)
def test_times_that_no_descent_has_are_refused_with_their_count(
    real: Path, predicted: pl.DataFrame, change: pl.Expr, said: str
) -> None:
    with pytest.raises(DataError, match=said):
        qualify(real, predicted.with_columns(time_s=change))


def test_a_table_without_times_is_refused(real: Path, predicted: pl.DataFrame) -> None:
    with pytest.raises(DataError, match="time_s or mean_s"):
        qualify(real, predicted.rename({"time_s": "eta"}))


def test_no_simulator_is_refused(real: Path) -> None:
    with pytest.raises(ConfigError, match="neither a simulator nor a type"):
        qualify(real)
