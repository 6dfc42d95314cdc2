"""The spread that the error of a wind adds to derived airspeeds, taken off again."""

import numpy as np
import polars as pl
import pytest
import torch
from torch import Tensor

import descentflow as df
from descentflow.air.air_smoother import matern
from descentflow.core.errors import DescentflowWarning
from descentflow.core.units import FT_M, KT_MPS
from descentflow.diagnosis.sides.input_descriptions import input_of_model
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.physics.atmosphere import isa_temperature_k
from descentflow.representation.airspeed_error import AirspeedErrors, _to_less, without_airspeed_error
from descentflow.representation.encode_flights import encode_flights
from descentflow.representation.profiles import Profiles, profiles_from_frame
from descentflow.training.datamodule import DescentDataModule

WIND_MPS, KELVINS = 2.5, 1.0
AIRSPEEDS = ("IAS", "Mach", "TAS", "heading")
LEVELS = slice(0, 180, 10)
HEIGHT_M = np.linspace(0.0, 14_000.0, 141)


def with_errors(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows of still standard air with columns of a weather that errs by flight over 8,000 ft, and in nothing else."""
    height = torch.from_numpy(HEIGHT_M)
    root = torch.linalg.cholesky(matern(height, height) + 1e-9 * torch.eye(len(height))).numpy()
    generator, parts = np.random.default_rng(1), []
    for flight in rows.sort("flight_id", "timestamp").partition_by("flight_id"):
        altitude_m = flight["altitude"].to_numpy() * FT_M
        drawn = generator.standard_normal((3, len(HEIGHT_M))) @ root.T
        east, north, warmer = (np.interp(altitude_m, HEIGHT_M, values) for values in drawn)
        columns = {
            "u_component_of_wind": WIND_MPS * east,
            "v_component_of_wind": WIND_MPS * north,
            "temperature": isa_temperature_k(torch.from_numpy(altitude_m)).numpy() + KELVINS * warmer,
        }
        parts.append(flight.with_columns(pl.Series(name, values) for name, values in columns.items()))
    return pl.concat(parts)


@pytest.fixture(scope="module")
def rows() -> pl.DataFrame:
    return with_errors(df.simulate("A320", 300, seed=0).rows)


@pytest.fixture(scope="module")
def derived(rows: pl.DataFrame) -> pl.DataFrame:
    return df.prepare(rows.drop(AIRSPEEDS), airspeeds_from="columns").frame


def on_grid(frame: pl.DataFrame) -> Profiles:
    return profiles_from_frame(frame, df.aircraft("A320"), 150, 340)


def spread_and_correlation(flights: Profiles) -> Tensor:
    """Deviation of CAS and its correlation with drag, (2, levels)."""
    found = []
    for cas, drag, seen in zip(
        flights.cas_mps.T[LEVELS], flights.drag_n.T[LEVELS], flights.mask.T[LEVELS], strict=True
    ):
        both = torch.stack([cas[seen], drag[seen]])
        found.append(torch.stack([both[0].std(), torch.corrcoef(both)[0, 1]]))
    return torch.stack(found, 1)


def test_the_map_leaves_the_covariance_without_what_was_added() -> None:
    root, error = torch.randn(6, 6).double(), 0.3 * torch.randn(6, 6).double()
    without, added = root @ root.T + 0.5 * torch.eye(6), error @ error.T
    less = _to_less(without + added, added)
    torch.testing.assert_close(less @ (without + added) @ less.T, without, rtol=1e-9, atol=1e-9)
    torch.testing.assert_close(less, less.T, rtol=1e-9, atol=1e-9)


def test_errors_of_a_field_have_a_common_part_one_of_a_flight_and_a_white_one() -> None:
    altitude_m = torch.tensor([1000.0, 1001.0, 3500.0, 14_000.0]).double()
    errors = AirspeedErrors(WIND_MPS, KELVINS, False, frozenset())
    covariance = errors.covariance(torch.full((4,), 140.0).double(), altitude_m)
    alike = covariance / torch.outer(covariance.diagonal().sqrt(), covariance.diagonal().sqrt())
    # By hand: Matern 5/2 at one length is 0.524, and nothing at five of them.
    expected = [0.95, 0.25 + 0.7 * 0.524, 0.25]
    torch.testing.assert_close(alike[0, 1:], torch.tensor(expected).double(), rtol=0, atol=0.005)


def test_flights_spread_as_those_that_report_their_airspeeds(rows: pl.DataFrame, derived: pl.DataFrame) -> None:
    flights, errors = on_grid(derived), AirspeedErrors.of(derived, WIND_MPS, KELVINS)
    assert errors is not None
    less = without_airspeed_error(flights, df.aircraft("A320"), errors, range(len(flights)), print)
    true, raw, found = map(spread_and_correlation, (on_grid(df.prepare(rows).frame), flights, less))
    # What is known of 300 flights: a spread to 4 % at a level, less of all levels together.
    assert float((raw[0] / true[0]).mean()) > 1.02
    assert abs(float((found[0] / true[0]).mean()) - 1) < 0.02
    assert float((raw[1] - true[1]).mean()) < -0.03
    assert abs(float((found[1] - true[1]).mean())) < 0.02
    torch.testing.assert_close(less.rate_mps, flights.rate_mps, rtol=0, atol=0)


def test_the_error_is_measured_where_flights_report_airspeeds_beside(rows: pl.DataFrame) -> None:
    reports = pl.col("icao24").hash(seed=0) % 2 == 0
    some = rows.with_columns(pl.when(reports).then(name).alias(name) for name in AIRSPEEDS)
    frame = df.prepare(some, airspeeds_from="columns").frame
    errors = AirspeedErrors.of(frame)
    assert errors is not None
    assert errors.measured
    assert errors.wind_mps == pytest.approx(WIND_MPS, rel=0.15)
    reported = frame.filter(pl.col("airspeed_source") == "reported")["flight_id"].unique().to_list()
    assert not errors.flight_ids & set(reported)
    # Flights that report their airspeeds stay as they are.
    flights = on_grid(frame)
    less = without_airspeed_error(flights, df.aircraft("A320"), errors, range(len(flights)), print)
    kept = torch.tensor([flight not in errors.flight_ids for flight in flights.flight_ids])
    assert torch.equal(less.cas_mps[kept], flights.cas_mps[kept])
    assert not torch.equal(less.cas_mps[~kept], flights.cas_mps[~kept])


def test_of_few_flights_nothing_is_taken_off_and_a_line_tells_it(derived: pl.DataFrame) -> None:
    flights, errors = on_grid(derived).subset(range(30)), AirspeedErrors.of(derived)
    assert errors is not None
    lines: list[str] = []
    same = without_airspeed_error(flights, df.aircraft("A320"), errors, range(30), lines.append)
    assert same is flights
    assert lines == ["airspeeds of 30 flights are derived: too few to take the error of their field off"]
    assert AirspeedErrors.of(derived.drop("airspeed_source")) is None


def test_a_fit_and_flights_to_compare_have_it_off(rows: pl.DataFrame) -> None:
    descents = df.prepare(rows.drop(AIRSPEEDS), airspeeds_from="columns")
    module = DescentDataModule(descents, bottom_fl=290, residual=False, wind_error_mps=2 * WIND_MPS)
    module.setup()
    train = module.profiles("train")
    raw = descents.frame.filter(pl.col("level_fl") == 300, pl.col("flight_id").is_in(train.flight_ids))
    assert float(train.cas_mps[train.mask[:, 10], 10].std()) < 0.97 * KT_MPS * float(raw["IAS"].std())
    lines: list[str] = []
    encode_flights(descents.frame, module.representation, say=lines.append)
    assert any("a wind error of 2.5 m/s" in line for line in lines)


def test_a_model_of_derived_flights_keeps_that_they_are(rows: pl.DataFrame) -> None:
    some = rows.filter(pl.col("flight_id").is_in(rows["flight_id"].unique().sort()[:90].implode()))
    model = df.fit(df.prepare(some.drop("IAS", "Mach"), airspeeds_from="columns"), model="gaussian").density
    made = model.representation.provenance
    assert made["derived"] == len(model.representation.split.train) > 50
    assert made["airspeeds"].startswith("airspeeds of 90 flights are derived: the spread of CAS")
    # The field's temperature is in TAS and in Mach, so that a diagnosis must compare neither.
    assert not {"mismatch", "tas"} & set(model.representation.reference["values"])
    assert f"the model: {made['airspeeds']}" in df.evaluate(model, df.prepare(some), n=200, n_splits=2).notes
    simulator = Simulator(df.aircraft("A320"), "a.ckpt", model=model)
    with pytest.warns(DescentflowWarning, match="of its flights with derived airspeeds"):
        assert input_of_model(simulator, model.representation).derived == made["derived"]
