"""From flights of known truth, observed with noise, to the drag inferred from them."""

import numpy as np
import polars as pl
import pytest

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.representation.profiles import profiles_from_frame
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.prepare import prepare


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """Retarding force (drag less thrust) inferred and true, for each flight and level of constant CAS."""
    aircraft = open_aircraft("A320")
    config = WorldConfig(level_off_share=0.0, managed_share=0.0)
    world = simulate(aircraft, 60, seed=5, scenario=config)
    path = tmp_path_factory.mktemp("world") / "rows.parquet"
    world.rows.write_parquet(path)
    descents = prepare(path)
    profiles = profiles_from_frame(descents.frame, aircraft, 150)
    speed = cas_to_tas_mps(profiles.cas_mps, profiles.altitude_m)
    inferred = profiles.drag_n - aircraft.idle_thrust_n(profiles.altitude_m, speed)
    # The inference knows neither the flight's mass nor its idle thrust: what the radar can tell is the retarding force
    # for each kilogram, here scaled to the reference mass.
    scale = dict(world.flights.select("flight_id", aircraft.mass_reference_kg / pl.col("mass_kg")).iter_rows())
    truth = {name: table for (name,), table in world.truth.sort("altitude_m").group_by("flight_id")}
    found = []
    for i, name in enumerate(profiles.flight_ids):
        table = truth[name].filter(pl.col("label") == "idle", pl.col("mach") < 0.99 * pl.col("mach").max())
        seen = profiles.mask[i] & (profiles.altitude_m < float(table["altitude_m"].to_numpy().max()) - 300)
        force = (table["drag_n"] - table["thrust_n"]).to_numpy() * scale[name]
        at = profiles.altitude_m[seen].numpy()
        true = np.interp(at, table["altitude_m"].to_numpy(), force)
        found.append(pl.DataFrame({"flight_id": name, "true": true, "inferred": inferred[i, seen].numpy()}))
    return pl.concat(found)


def test_inferred_drag_has_no_bias_and_the_noise_of_the_reported_rate(compared: pl.DataFrame) -> None:
    """Stated error on constant-CAS legs: mean below 1.5 %, half of the levels within 3 %, nine in ten within 8 %.

    A reported rate carries some 40 ft/min of noise and steps of 32 ft/min, 2 % of 2,000 ft/min; speed held by pitch
    adds to it. Measured when this was written: mean 0.7 %, half within 1.9 %, nine in ten within 4.9 %.
    """
    error = (compared["inferred"] / compared["true"] - 1).to_numpy()
    assert len(error) > 5000
    assert abs(error.mean()) < 0.015
    assert np.median(np.abs(error)) < 0.03
    assert np.quantile(np.abs(error), 0.9) < 0.08


def test_the_noise_averages_out_over_a_flight(compared: pl.DataFrame) -> None:
    """The middle flight's mean error is below 0.5 %: what is left is noise and not the equation."""
    by_flight = compared.group_by("flight_id").agg((pl.col("inferred") / pl.col("true") - 1).mean().alias("error"))
    assert abs(by_flight["error"].median()) < 0.005
