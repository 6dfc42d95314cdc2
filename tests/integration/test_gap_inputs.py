"""Every form in which flights and a simulator can be given to a diagnosis, and the settings that travel with them."""

from dataclasses import replace
from pathlib import Path

import gap_toys
import polars as pl
import pytest
import torch
import toys
from bada4_dummies import dummies

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.errors import AircraftError, ConfigError, DataError, DescentflowWarning
from descentflow.densities.checkpoint import load_model
from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
from descentflow.effects import EFFECTS
from descentflow.effects._example_flights import example_flights
from descentflow.effects.vertical_rate_lag import _late
from descentflow.simulation.world import simulate
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents, write_descents
from descentflow.surveillance.prepare import prepare
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.models import Gaussian

SMALL = {name: EFFECTS[name] for name in ("temperature", "mass")}
"""A catalogue that is fitted quickly: what is compared are answers by one way and by another."""
STRICT = Cleaning(slowest_fpm=1200.0, transient_s=60.0)
"""Settings under which descents begin later and hold only the steep part."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``simulator.ckpt`` of 300 flights, and ``rows.parquet`` of 200 others of the same world, not yet cleaned."""
    place = tmp_path_factory.mktemp("inputs")
    for name, flights, seed in (("own.parquet", 300, 0), ("rows.parquet", 200, 1)):
        simulate(open_aircraft("A320"), flights, seed).rows.write_parquet(place / name)
    write_descents(prepare([place / "own.parquet"], cleaning=STRICT), place / "own_descents.parquet")
    write_descents(prepare([place / "rows.parquet"], cleaning=STRICT), place / "alike.parquet")
    write_descents(prepare([place / "rows.parquet"]), place / "default.parquet")
    gap_toys.simulator(place, place / "own_descents.parquet")
    return place


def findings_alone(report: GapReport) -> dict[str, object]:
    """Without the names of the files, which say by which way the flights came."""
    return {name: value for name, value in report.as_dict().items() if name != "provenance"}


def test_rows_are_cleaned_as_the_simulator_s_own_flights_were(folder: Path) -> None:
    of_rows = diagnose(folder / "rows.parquet", folder / "simulator.ckpt", catalogue=SMALL)
    of_descents = diagnose(folder / "alike.parquet", folder / "simulator.ckpt", catalogue=SMALL)
    assert of_rows.verdict == "none"
    assert findings_alone(of_rows) == findings_alone(of_descents)


def test_other_settings_are_warned_of_and_would_pass_for_a_gap(folder: Path) -> None:
    with pytest.warns(DescentflowWarning, match=r"slowest_fpm is 500 in these descents and 1200"):
        report = diagnose(folder / "default.parquet", folder / "simulator.ckpt", catalogue=SMALL)
    assert report.p_value < 0.02


def test_a_simulator_may_be_a_path_a_density_or_a_fitted_model(folder: Path) -> None:
    real = read_descents(folder / "alike.parquet")
    data = DescentDataModule(folder / "own_descents.parquet", aircraft="A320")
    model = toys.fit(Gaussian(), data, 1)
    path, density = folder / "simulator.ckpt", load_model(folder / "simulator.ckpt")
    found = [diagnose(real, simulator, catalogue=SMALL) for simulator in (path, str(path), density, model)]
    assert {(report.verdict, report.p_value, report.gap_before) for report in found} == {
        (found[0].verdict, found[0].p_value, found[0].gap_before)
    }


def test_nominal_bada_may_be_a_designator_or_coefficients(folder: Path) -> None:
    real = folder / "default.parquet"
    by_name, by_keyword, by_coefficients = (
        diagnose(real, "A320", catalogue=SMALL),
        diagnose(real, typecode="A320", catalogue=SMALL),
        diagnose(real, open_aircraft("A320"), catalogue=SMALL),
    )
    assert findings_alone(by_name) == findings_alone(by_keyword) == findings_alone(by_coefficients)
    with pytest.raises(AircraftError):
        diagnose(real, "ZZZ9")
    model = Inputs(real, "Dummy-TWIN", bada_dir=dummies(), any_type=True).open().simulator.aircraft
    assert model.source == "BADA 4.3 file Dummy-TWIN"
    with pytest.raises(DataError, match=r"no file Dummy-TWIN; .* ask for nominal BADA with typecode"):
        diagnose(real, Path("Dummy-TWIN"), bada_dir=dummies())
    with pytest.raises(ConfigError, match="a model of type int"):
        diagnose(real, 3)
    with pytest.raises(ConfigError, match="BADA files for a simulator"):
        diagnose(real, folder / "simulator.ckpt", bada_dir=folder)


def test_flights_of_other_types_are_left_out_counted_and_named(folder: Path) -> None:
    given = read_descents(folder / "alike.parquet")
    real = given.frame
    named = real.select("flight_id").unique().sort("flight_id").head(30)["flight_id"]
    other = pl.when(pl.col("flight_id").is_in(named.implode())).then(pl.lit("B738")).otherwise(pl.lit("A320"))
    mixed = Descents(real.with_columns(typecode=other), given.metadata)
    for simulator in (folder / "simulator.ckpt", "A320"):
        with pytest.warns(DescentflowWarning, match="flights of other types are left out: 30 of B738; --any-type"):
            opened = Inputs(mixed, simulator).open()
        assert opened.frame["typecode"].unique().to_list() == ["A320"]
        assert opened.dropped["flights_of_B738"] == 30
        everyone = Inputs(mixed, simulator, any_type=True).open()
        assert len(everyone.frame) == len(real)
        assert "flights_of_B738" not in everyone.dropped
        assert opened.simulator.coefficients is None
        used = everyone.simulator.coefficients
        assert str(used) == "Signatures are those of the A320's coefficients, which stand for the A320, B738."


def test_a_late_rate_begins_where_the_settings_say() -> None:
    state = example_flights()
    rate = torch.full_like(state.cas_mps, 10.0)
    late = _late(rate, replace(state, cleaning=STRICT), 12.0).exp()
    # From 1,200 ft/min, 60 s before the first level, the report comes up to 10 m/s with a time constant of 12 s.
    time = 60.0 + (state.altitude_m[-1] - state.altitude_m) / 10.0
    torch.testing.assert_close(late[0], 10.0 - (10.0 - 6.096) * torch.exp(-time / 12.0), rtol=1e-9, atol=0)
