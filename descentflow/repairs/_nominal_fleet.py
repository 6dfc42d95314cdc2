"""Descents of a repaired type as its flights differ: for programs that fly means and spreads by level."""

import numpy as np
import polars as pl
import torch

from descentflow.core.units import FL_M, FPM_MPS, FT_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, crossover_altitude_m, mach_to_cas_mps, mach_to_tas_mps
from descentflow.physics.energy import descent_rate_mps, energy_share_factor
from descentflow.repairs.mixed_model import Z_90
from descentflow.repairs.repair_found import Repair

FLEET_SIZE = 400
LOW_CAS_M = 10_000 * FT_M
STEP_FL = 5.0
USUAL = {"des_mach": 0.01, "des_cas_high_kt": 10.0}
"""Spread between aircraft of a speed that too few of them show."""


def nominal_fleet(repair: Repair) -> pl.DataFrame:
    """Flights (400) in the columns of samples, by speeds and rates as the type's flights spread; the same every time.

    Example:
        >>> from descentflow.repairs.repair import repair
        >>> nominal_fleet(repair("descents.parquet", aircraft="A320")).columns
        ['sample_id', 'level_fl', 'time_s', 'vertical_rate', 'CAS', 'Mach']
    """
    after, sizes = repair.after, repair.posterior.sizes
    rng = np.random.default_rng(0)
    levels = torch.arange(*repair.levels_fl, STEP_FL, dtype=torch.float64)
    altitude = levels * FL_M
    spread = {
        one.name: (one.high - one.low) / (2 * Z_90) * one.aircraft**0.5 for one in repair.estimates if one.aircraft
    }
    drawn = {
        name: torch.from_numpy(float(getattr(after, name)) + spread.get(name, usual) * rng.normal(size=(FLEET_SIZE, 1)))
        for name, usual in USUAL.items()
    }
    mach, cas = drawn["des_mach"], drawn["des_cas_high_kt"] * KT_MPS
    cas = torch.where(altitude < LOW_CAS_M, torch.minimum(cas, torch.tensor(float(after.des_cas_low_kt) * KT_MPS)), cas)
    above = (altitude > crossover_altitude_m(cas, mach)) & (mach > 0)
    flown = torch.where(above, mach_to_cas_mps(mach, altitude), cas)
    number = cas_to_mach(flown, altitude)
    tas = mach_to_tas_mps(number, altitude)
    share = energy_share_factor(number, altitude, above)
    rate = -descent_rate_mps(
        after, after.drag_n(tas, altitude), after.idle_thrust_n(altitude, tas), tas, share, altitude
    )
    level = np.hypot(sizes.aircraft, sizes.flight)
    rate = rate * torch.from_numpy(np.exp(level * rng.normal(size=(FLEET_SIZE, 1))))
    seconds = STEP_FL * FL_M * 2 / (rate[:, 1:] + rate[:, :-1])
    time = torch.nn.functional.pad(seconds.flip(1).cumsum(1).flip(1), (0, 1))
    order = range(len(levels) - 1, -1, -1)
    columns = {"time_s": time, "vertical_rate": -rate / FPM_MPS, "CAS": flown / KT_MPS, "Mach": number}
    index = {
        "sample_id": np.repeat(np.arange(FLEET_SIZE, dtype=np.int32), len(levels)),
        "level_fl": np.tile(levels.numpy()[::-1], FLEET_SIZE),
    }
    return pl.DataFrame(
        {**index, **{name: value[:, list(order)].reshape(-1).numpy() for name, value in columns.items()}}
    )
