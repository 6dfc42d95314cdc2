"""Flights by the full equation of motion: the decoder's time, and the drag inferred from noisy reports of them."""

import numpy as np
import polars as pl
import pytest
import torch
from scipy.interpolate import CubicSpline
from toys import AIRCRAFT

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.units import FL_M
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.representation.decoder.trajectories import integrate
from descentflow.representation.profiles import profiles_from_frame
from descentflow.simulation.flight import Flown, fly
from descentflow.simulation.parameters import FlightParameters, draw_parameters
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.prepare import prepare

FLIGHTS = 6
SETTLED_S = 45
"""After the autopilot calls the descent idle: the last of the thrust that it takes off, 1 % of the drag, is gone."""
BOUND = 5e-4
"""0.05 % of the descent's time; measured: 0.011 % in still air, 0.016 % in winds of 2 to 3 m/s a kilometre."""


def flown_by_both(flown: Flown, p: FlightParameters, i: int, exact: bool) -> tuple[np.ndarray, np.ndarray]:
    """Seconds from the highest level to each level of one idle descent: of the decoder and of the world."""
    idle = (flown.flying[:, i] & (flown.label[:, i] == 1)).nonzero()[:, 0]
    rows = torch.arange(int(idle[0]) + SETTLED_S, int(idle[-1]) + 1).flip(0)
    at = flown.altitude_m[rows, i].numpy()
    assert (np.diff(at) > 0).all()
    wind = p.wind_mps[i] + p.wind_slope_per_s[i] * flown.height_m[rows, i]
    seconds, drag, cas, tailwind = (
        CubicSpline(at, values.numpy())
        for values in (flown.time_s[rows], flown.drag_n[rows, i], flown.cas_mps[rows, i], wind)
    )
    levels = torch.arange(np.ceil(at[0] / FL_M) + 2, np.floor(at[-1] / FL_M) - 1, dtype=torch.float64)
    altitude = levels * FL_M

    def on_levels(curve: CubicSpline) -> torch.Tensor:
        return torch.from_numpy(curve(altitude.numpy()))[None]

    path = (levels, altitude, on_levels(drag), on_levels(cas), torch.tensor([len(levels) - 1]))
    options = {"wind_mps": on_levels(tailwind), "exact_energy_share": exact}
    decoded = integrate(AIRCRAFT, *path, p.mass_kg[i], p.deviation_k[i], **options)
    true = seconds(altitude.numpy())
    return decoded.time_s[0].numpy(), true - true[-1]


@pytest.mark.parametrize(("deviation_k", "wind_slope_per_s"), [(0.0, 0.0), (15.0, 0.003), (-10.0, -0.002)])
def test_decoded_time_is_that_of_the_equation_of_motion(deviation_k: float, wind_slope_per_s: float) -> None:
    """Drag, CAS and wind of the world in, its time out: through Mach and CAS phases and the pilot's wander."""
    # A spread of idle thrust is not the decoder's: it takes the type's own.
    config = WorldConfig(
        level_off_share=0.0,
        managed_share=0.0,
        thrust_spread=0.0,
        interval_s=1,
        deviation_mean_k=deviation_k,
        wind_slope_mean_per_s=wind_slope_per_s,
    )
    p = draw_parameters(AIRCRAFT, range(FLIGHTS), 3, config)
    flown = fly(AIRCRAFT, p, config)
    off, by_bada = [], []
    for i in range(FLIGHTS):
        decoded, true = flown_by_both(flown, p, i, exact=True)
        assert true[0] > 100
        off.append(np.abs(decoded - true).max() / true[0])
        decoded, true = flown_by_both(flown, p, i, exact=False)
        by_bada.append(abs(decoded[0] / true[0] - 1))
    # In wind the decoder leaves out the cosine of the path, 0.3 % of what the wind takes.
    assert max(off) < BOUND
    # BADA's own factor misses what the speed does beside held Mach and held CAS: per cents, not the quadrature's error.
    assert max(by_bada) > 10 * BOUND


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
    tables = []
    for i, name in enumerate(profiles.flight_ids):
        table = truth[name].filter(pl.col("label") == "idle", pl.col("mach") < 0.99 * pl.col("mach").max())
        seen = profiles.mask[i] & (profiles.altitude_m < float(table["altitude_m"].to_numpy().max()) - 300)
        force = (table["drag_n"] - table["thrust_n"]).to_numpy() * scale[name]
        at = profiles.altitude_m[seen].numpy()
        true = np.interp(at, table["altitude_m"].to_numpy(), force)
        tables.append(pl.DataFrame({"flight_id": name, "true": true, "inferred": inferred[i, seen].numpy()}))
    return pl.concat(tables)


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
