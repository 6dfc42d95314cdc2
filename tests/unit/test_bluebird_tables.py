"""bluebird-dt's tables of flights of which none has a part at constant Mach number."""

import numpy as np
import polars as pl
import pytest
import torch

from descentflow.core.units import FL_M, KT_MPS
from descentflow.exports.bluebird_tables import tables
from descentflow.physics.airspeed import cas_to_mach

LEVELS = np.arange(60.0, 156.0, 5.0)
TOP_M = torch.tensor([155.0 * FL_M])


def low_flights(n: int) -> pl.DataFrame:
    """Flights of one CAS each, 200 to 220 kt, from FL155 to FL60 at one rate each, 1,450 to 1,550 ft/min."""
    parts = []
    for i, (cas, rate) in enumerate(zip(np.linspace(200, 220, n), np.linspace(1450, 1550, n), strict=True)):
        mach = cas_to_mach(torch.full((len(LEVELS),), cas * KT_MPS), torch.from_numpy(LEVELS * FL_M))
        columns = {"level_fl": LEVELS, "CAS": cas, "Mach": mach.numpy(), "vertical_rate": -rate}
        parts.append(pl.DataFrame({"sample_id": i, "time_s": (155 - LEVELS) * 6000 / rate, **columns}))
    return pl.concat(parts)


def test_low_flights_are_limited_by_their_cas_alone() -> None:
    profile, spread = tables(low_flights(40))
    mach = cas_to_mach(torch.linspace(200, 220, 40).double()[:, None] * KT_MPS, TOP_M)
    assert profile["cas_des"] == pytest.approx([210.0] * len(profile["flight_level"]))
    assert profile["mach_des"] == pytest.approx([float(mach.mean())] * len(profile["flight_level"]), abs=1e-4)
    assert profile["rocd_des"] == pytest.approx([1500.0] * len(profile["flight_level"]), rel=0.01)
    assert spread["mach_des"]["sigma"] == pytest.approx(float(mach.std()), abs=1e-4)
