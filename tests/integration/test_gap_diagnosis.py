"""A short study: a simulator of the world's flights, diagnosed with and without planted effects, and bad input."""

import dataclasses
import json
import re
from importlib import import_module
from pathlib import Path

import gap_toys
import polars as pl
import pytest
import torch
import toys
from bada4_dummies import dummies
from refusals import refuses

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.cli.entry import main
from descentflow.core.errors import AircraftError, ConfigError, DataError, DescentflowWarning
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.densities.checkpoint import load_model
from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.findings.read_gap import read_gap
from descentflow.diagnosis.report.gap_report import KEYS, GapReport
from descentflow.diagnosis.report.page import page
from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
from descentflow.effects import EFFECTS
from descentflow.generation.rejection import sample_descents
from descentflow.measurements.level_channels import LevelGrid
from descentflow.physics.airspeed import mach_to_tas_mps
from descentflow.physics.atmosphere import isa_temperature_k
from descentflow.representation.context import ContextEncoder
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models import Gaussian

SMALL = {name: EFFECTS[name] for name in ("temperature", "mass", "wind_gradient", "speed_schedule")}
"""A catalogue that is fitted quickly, where which effect is found is not what is asked."""
FEW = {name: SMALL[name] for name in ("temperature", "mass")}
"""A catalogue of two, where only answers by one way and by another are compared."""
BASIC = ("IAS", "Mach", "vertical_rate")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("diagnosis")


@pytest.fixture(scope="module")
def plain(folder: Path) -> Path:
    """Flights of the simulator's own world."""
    return gap_toys.flights(folder, 120, seed=2)


@pytest.fixture(scope="module")
def checkpoint(folder: Path) -> Path:
    return gap_toys.simulator(folder, gap_toys.flights(folder, 220, seed=0))


@pytest.fixture(scope="module")
def warm(folder: Path, checkpoint: Path) -> tuple[GapReport, Path]:
    """Warm air, through the command line and of few effects; the README's lines find it among all."""
    path = gap_toys.flights(folder, 120, seed=1, config=WorldConfig(deviation_mean_k=10.0))
    out = folder / "warm"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(import_module("descentflow.diagnosis.diagnose"), "EFFECTS", SMALL)
        assert main(["diagnose", "--real", str(path), "--simulator", str(checkpoint), "--out", str(out)]) == 0
    return diagnose(path, checkpoint, catalogue=SMALL), out


def test_flights_of_the_same_world_are_no_gap(plain: Path, checkpoint: Path) -> None:
    report = diagnose(plain, checkpoint)
    assert report.verdict == "none"
    assert report.causes == []
    assert report.p_value > 0.03
    assert not report.corrections


def test_warm_air_is_named_sized_and_closed(warm: tuple[GapReport, Path]) -> None:
    report, _ = warm
    assert report.verdict == "effect"
    assert [cause.effect for cause in report.causes] == ["temperature"]
    size = report.causes[0].parameters["deviation_k"]
    assert size.low - 0.1 < 10.0 < size.high + 0.1
    assert report.causes[0].closure.marginal.estimate > 0.9
    assert report.gap_after < 0.1 * report.gap_before
    assert report.where[0].quantity in ("tas", "height")


def test_the_written_report_says_what_the_object_says(warm: tuple[GapReport, Path]) -> None:
    """Also that the same seed gives the same answer: one was written by another run."""
    report, out = warm
    written = json.loads((out / "gap.json").read_text())
    assert set(KEYS) <= set(written)
    assert written == json.loads(json.dumps(report.as_dict()))
    page = re.sub("</?span>", "", (out / "gap.html").read_text())
    assert "air warmer than the standard atmosphere" in page
    assert page.count("<figure>") == 8
    # The top names what differs, what it costs and what the cause takes away of it.
    top = page[: page.index("<section")]
    assert "The simulator and the 120 real A320 flights differ" in top
    assert re.search(r"Real flights minus the simulator: [-+][\d.]+ s, [-+][\d.]+ NM, -\d+ ft/min", top)
    assert re.search(r"Temperature takes away: \+[\d.]+ s, [-+][\d.]+ NM, -\d+ ft/min", top)
    assert re.search(r"ISA \+\d.* K \(.*\), FL150 to FL\d+", page)
    assert f"descentflow sample {out}/corrected.ckpt" in page
    assert read_gap(out / "gap.json").causes == report.causes


def test_warm_air_costs_what_it_takes(warm: tuple[GapReport, Path]) -> None:
    """Two to three per cent of the time for ten kelvin, which the cause takes away again."""
    cost = next(cost for cost in warm[0].costs if cost.name == "time_at_speed")
    assert (cost.low_fl, cost.unit) == (150.0, "s")
    assert 0.005 < cost.before.estimate / cost.simulator < 0.05
    assert abs(cost.after.estimate) < abs(cost.before.estimate)
    assert abs(cost.after.estimate) < 2 * cost.floor


def test_the_corrected_simulator_samples_warm_air(warm: tuple[GapReport, Path], checkpoint: Path) -> None:
    ratio = []
    before, after = load_model(checkpoint), load_model(warm[1] / "corrected.ckpt")
    for model in (before, after):
        parts = model.representation
        flown = sample_descents(model, parts, 200, seed=0).trajectories
        ratio.append((flown.tas_mps.mean(), flown.rate_mps.mean(), flown.time_s[:, 0].mean()))
    tas, rate, time = (float(a / b) for b, a in zip(*ratio, strict=True))
    assert tas == pytest.approx(1.021, abs=0.004)
    assert rate == pytest.approx(0.977, abs=0.008)
    assert time == pytest.approx(1 / rate, abs=0.01)


def test_samples_with_the_cause_are_descents_like_any_other(warm: tuple[GapReport, Path]) -> None:
    report, out = warm
    corrected = read_descents(out / "corrected.parquet")
    assert corrected.flights == {"A320": 400}
    assert corrected.cleaning == read_descents(out.parent / "descents0.parquet").cleaning
    assert report.recipe[0].text.startswith("ISA +")


def test_without_true_airspeed_drag_is_still_found(folder: Path, checkpoint: Path) -> None:
    path = gap_toys.flights(
        folder, 120, seed=3, change=lambda p: dataclasses.replace(p, cd0_factor=1.15 * p.cd0_factor)
    )
    alike = {name: EFFECTS[name] for name in (*SMALL, "drag_polar", "idle_thrust")}
    report = diagnose(path, checkpoint, channels=BASIC, catalogue=alike)
    assert report.verdict == "effect"
    cause = report.causes[0]
    assert "drag_polar" in (cause.effect, *cause.group)
    assert any("scaled together" in row.why for row in report.would_split)
    assert report.details.quantities.count("tas") == 0


def test_an_effect_that_is_not_in_the_catalogue_is_unknown(warm: tuple[GapReport, Path], folder: Path) -> None:
    others = {name: effect for name, effect in EFFECTS.items() if name != "temperature"}
    report = diagnose(folder / "descents1.parquet", folder / "simulator.ckpt", catalogue=others)
    assert report.verdict == "unknown"
    assert report.remaining.largest.quantity in ("tas", "height")


def test_nominal_bada_shows_the_mass_that_flew(plain: Path, checkpoint: Path) -> None:
    """The world's A320 are lighter than the reference mass, which nominal BADA flies."""
    report = diagnose(plain, typecode="A320")
    assert report.verdict == "effect"
    cause = report.causes[0]
    assert "mass" in (cause.effect, *cause.group)


@pytest.mark.filterwarnings("ignore:the cleaning settings:descentflow.core.errors.DescentflowWarning")
def test_bad_input_gets_a_clear_error(plain: Path, folder: Path, checkpoint: Path) -> None:
    frame = read_descents(plain).frame
    with pytest.raises(DataError, match=r"descents of B738 for a simulator of A320"):
        diagnose(frame.with_columns(typecode=pl.lit("B738")), checkpoint)
    lower = frame.filter(pl.col("level_fl") < 170).with_columns(pl.col("level_fl") - 25)
    refuses(DataError, "no descent between", diagnose, lower, checkpoint)
    with pytest.raises(DataError, match=r"column level_fl holds .* outside 0 to 600"):
        diagnose(frame.with_columns(pl.col("level_fl") - 500), checkpoint)
    refuses(ConfigError, "channel 'speed'", diagnose, frame, checkpoint, channels=["speed"])
    refuses(DataError, "no file", diagnose, folder / "nothing.parquet", checkpoint)
    refuses(DataError, "no column Mach; expected flight_id", diagnose, frame.drop("Mach"), checkpoint)
    given = load_model(checkpoint)
    given.representation.context = ContextEncoder.fit(pl.DataFrame({"entry_fl": [300.0, 340.0]}), ["entry_fl"])
    refuses(ConfigError, "a simulator that is given a context", diagnose, frame, given)


def test_a_corrected_simulator_is_refused_before_anything_is_done(warm: tuple[GapReport, Path], folder: Path) -> None:
    with pytest.raises(ConfigError, match=r"corrected.ckpt, a simulator that is corrected already.*corrected.parquet"):
        diagnose(folder / "descents1.parquet", warm[1] / "corrected.ckpt", catalogue=SMALL, out=folder / "again")
    assert not (folder / "again" / "gap.json").exists()


def test_real_flights_in_other_air_than_the_training_flights(plain: Path, folder: Path) -> None:
    """Trained in ISA+10, real flights in ISA+0: samples agree with the real flights in rate, time and TAS."""
    inside = folder / "trained_warm"
    inside.mkdir()
    trained = gap_toys.flights(inside, 120, seed=1, config=WorldConfig(deviation_mean_k=10.0))
    checkpoint = gap_toys.simulator(inside, trained)
    report = diagnose(plain, checkpoint, catalogue=SMALL, out=inside / "gap")
    assert [cause.effect for cause in report.causes] == ["temperature"]
    cause = report.causes[0]
    assert cause.text == "air colder than that of the simulator's flights"
    (sides,) = cause.on_both_sides
    assert (sides.flights, sides.simulator) == (pytest.approx(0.0, abs=1.0), pytest.approx(10.0, abs=1.5))
    assert re.match(r"temperature -9.*K \(.*\): ISA .* against the simulator's ISA \+", report.recipe[0].text)
    assert "Those of the simulator report the TAS of standard air." in str(report)
    model = load_model(inside / "gap" / "corrected.ckpt")
    parts = model.representation
    flown = sample_descents(model, parts, 400, seed=0).trajectories
    levels = flown.levels_fl
    real = LevelGrid.of_frame(
        read_descents(plain).frame, float(levels[0]), float(levels[-1]), ["IAS", "vertical_rate", "TAS", "Mach"]
    )
    every = (real.values["TAS"] * KT_MPS, real.values["Mach"], real.mask)
    sampled = (flown.tas_mps, flown.mach, flown.mask)
    for tas, mach, mask in (every, sampled):
        ratio = tas / mach_to_tas_mps(mach.double(), levels * FL_M)
        deviation = isa_temperature_k(levels.double() * FL_M) * (ratio.square() - 1)
        assert float(deviation[mask].nanmean()) == pytest.approx(0.0, abs=1.0)
    written = read_descents(inside / "gap" / "corrected.parquet").frame
    assert written["TAS"].mean() == pytest.approx(read_descents(plain).frame["TAS"].mean(), rel=0.01)
    middle = (levels >= 160) & (levels <= 260)
    rates = [
        torch.where(mask, rate, torch.nan)[:, middle].nanmean()
        for rate, mask in ((real.values["vertical_rate"] * FPM_MPS, real.mask), (flown.rate_mps, flown.mask))
    ]
    # Means of 86 training flights and of 120 others differ by one to two per cent.
    assert float(rates[1] / rates[0]) == pytest.approx(1.0, abs=0.03)
    # The same draws before: what ten kelvin take of the rate, they add to the time.
    model = load_model(checkpoint)
    before = model.representation.decoder(model.sample(400, seed=0))
    after = parts.fly(model.sample(400, seed=0))
    rate = float(after.rate_mps.mean() / before.rate_mps.mean())
    time = float(after.time_s.mean() / before.time_s.mean())
    assert rate == pytest.approx(1.023, abs=0.008)
    assert time == pytest.approx(1 / rate, abs=0.01)


def test_a_simulator_may_be_a_path_a_density_or_a_fitted_model(plain: Path, folder: Path, checkpoint: Path) -> None:
    model = toys.fit(Gaussian(), DescentDataModule(folder / "descents0.parquet", aircraft="A320"), 1)
    simulators = (checkpoint, str(checkpoint), load_model(checkpoint), model)
    reports = [diagnose(read_descents(plain), simulator, catalogue=FEW) for simulator in simulators]
    assert len({(report.verdict, report.p_value, report.gap_before) for report in reports}) == 1


def test_nominal_bada_may_be_a_designator_or_coefficients(plain: Path, checkpoint: Path) -> None:
    ways = ({"simulator": "A320"}, {"typecode": "A320"}, {"simulator": open_aircraft("A320")})
    reports = [diagnose(plain, **way, catalogue=FEW).as_dict() | {"provenance": None} for way in ways]
    assert reports[0] == reports[1] == reports[2]
    with pytest.raises(AircraftError):
        diagnose(plain, "ZZZ9")
    model = Inputs(plain, "Dummy-TWIN", bada_dir=dummies(), any_type=True).open().simulator.aircraft
    assert model.source == "BADA 4.3 file Dummy-TWIN"
    with pytest.raises(DataError, match=r"no file Dummy-TWIN; .* ask for nominal BADA with typecode"):
        diagnose(plain, Path("Dummy-TWIN"), bada_dir=dummies())
    refuses(ConfigError, "a model of type int", diagnose, plain, 3)
    refuses(ConfigError, "BADA files for a simulator", diagnose, plain, checkpoint, bada_dir=dummies())


def test_flights_of_other_types_are_left_out_counted_and_named(plain: Path, checkpoint: Path) -> None:
    given = read_descents(plain)
    others = given.frame["flight_id"].unique().sort().head(30)
    typecode = pl.when(pl.col("flight_id").is_in(others.implode())).then(pl.lit("B738")).otherwise(pl.lit("A320"))
    mixed = Descents(given.frame.with_columns(typecode=typecode), given.metadata)
    for simulator in (checkpoint, "A320"):
        with pytest.warns(DescentflowWarning, match="flights of other types are left out: 30 of B738; --any-type"):
            opened = Inputs(mixed, simulator).open()
        assert opened.frame["typecode"].unique().to_list() == ["A320"]
        assert opened.dropped["flights_of_B738"] == 30
        everyone = Inputs(mixed, simulator, any_type=True).open()
        assert len(everyone.frame) == len(given.frame)
        assert "flights_of_B738" not in everyone.dropped
        assert opened.simulator.coefficients is None
        used = everyone.simulator.coefficients
        assert str(used) == "Signatures are those of the A320's coefficients, which stand for the A320, B738."


def test_torch_is_left_as_it_was(plain: Path, checkpoint: Path) -> None:
    """The answer depends on its own seed, and moves nobody else's."""
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    diagnose(plain, typecode="A320", catalogue=SMALL)
    assert torch.equal(torch.rand(3), expected)


def test_a_checkpoint_without_flights_of_its_own_is_refused(plain: Path, checkpoint: Path) -> None:
    model = load_model(checkpoint)
    model.representation.reference = None
    refuses(DataError, r"keeps no flights.*pass the samples as --simulator", diagnose, plain, model, catalogue=SMALL)


def test_a_cause_that_the_simulator_inherited_is_found_against_physics(folder: Path) -> None:
    inside = folder / "inherited"
    inside.mkdir()
    path = gap_toys.simulator(inside, folder / "descents1.parquet")
    words = "96 of the 120 real flights are some that {} was trained or validated on"
    with pytest.warns(DescentflowWarning, match=words.format("simulator.ckpt")):
        report = diagnose(folder / "descents1.parquet", path, catalogue=SMALL)
    words = words.format("the simulator")
    assert words in str(report)
    assert words in page(report)
    assert report.dropped["flights_that_the_simulator_has_seen"] == 96
    assert report.details.regime == "refit"
    assert [cause.effect for cause in report.causes] == ["temperature"]
    assert report.causes[0].inherited
    assert "not identifiable" in report.would_split[0].why
