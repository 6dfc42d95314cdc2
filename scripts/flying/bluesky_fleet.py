"""Descents flown by BlueSky, headless, with its own autopilot and performance model, by its own commands."""

import contextlib
import io
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import FunctionType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from descentflow.core.errors import DataError
from descentflow.core.tabular import optional_library
from descentflow.core.units import FPM_MPS, FT_M, KT_MPS
from descentflow.physics.atmosphere import geometric_altitude_m
from flying.flight_plans import FlightPlan, cas_of_mach_kt
from flying.profiles import Profile

Array = NDArray[np.float64]

STEP_S = 0.5
"""Of the simulation; BlueSky's own default is 0.05 s, which ten times longer changes nothing that a radar sees."""
ABOVE_FL = 10.0
"""Flights begin so far above their first report: BlueSky ramps its vertical speed up within seconds."""
LONGEST_S = 5400.0
"""A descent that is not down by then never will be."""
WIND_FROM_BEHIND_DEG = 270
"""Flights head east, so that wind from the west is tailwind."""


@dataclass(frozen=True)
class Orders:
    """Commands next to the speeds; without any BlueSky flies as it comes.

    Attributes:
        step_ft: Altitudes are commanded so many feet below the flight and no further (None: the lowest at once).
        rates_fpm: Vertical speeds by level, negative down (None: BlueSky's own).
        rate_spread: Each flight's rates are of its own size: standard deviation of their logarithm.
        wind_kt: Tailwind by level.
        faster_kt: Added to the CAS of every flight.
        warmer_k: Its air is so much warmer than the standard atmosphere: BlueSky has no command for it, so two of its
            functions are replaced.
        seed: Of the flights' own rates.
    """

    step_ft: float | None = None
    rates_fpm: Profile | None = None
    rate_spread: float = 0.0
    wind_kt: Profile | None = None
    faster_kt: float = 0.0
    warmer_k: float = 0.0
    seed: int = 0


def start() -> Any:
    """BlueSky without network and windows, in a folder of its own; its output on the way is not shown.

    Raises:
        ConfigError: If it is not installed.
    """
    bluesky = optional_library("bluesky")
    folder = tempfile.mkdtemp(prefix="descentflow-bluesky-")
    with contextlib.redirect_stdout(io.StringIO()):
        bluesky.init(mode="sim", detached=True, workdir=folder)
    return bluesky


def fly(
    bluesky: Any, plans: Sequence[FlightPlan], orders: Orders, progress: Callable[[float], None] | None = None
) -> list[dict[str, Array]]:
    """States of every flight from its first to its lowest level, a second apart.

    Raises:
        DataError: If BlueSky does not know a type (it would fly a B744 instead), or a flight does not come down.
    """
    _check_types(bluesky, plans)
    warm_air(bluesky, orders.warmer_k)
    with contextlib.redirect_stdout(io.StringIO()):
        bluesky.sim.reset()
    fleet = _Fleet(bluesky, plans, orders)
    kept: list[list[Array]] = [[] for _ in plans]
    while not fleet.down.all():
        if fleet.time_s > LONGEST_S:
            left = ", ".join(plans[i].flight_id for i in np.flatnonzero(~fleet.down)[:5])
            raise DataError(f"{left} not down after {LONGEST_S:g} s", expected="descents", mend="command steeper rates")
        fleet.command()
        fleet.advance(1.0)
        states = fleet.states()
        for i in np.flatnonzero(~fleet.down):
            kept[i].append(states[:, i])
        fleet.land()
        if progress is not None:
            progress(fleet.time_s)
    return [_state(np.array(rows), plan, orders.warmer_k) for rows, plan in zip(kept, plans, strict=True)]


def warm_air(bluesky: Any, warmer_k: float) -> None:
    """Make BlueSky's air warmer than the standard atmosphere by so much, at the same pressure: 0 for as it comes."""
    aero = bluesky.tools.aero
    if not hasattr(aero, "standard_vatmos"):
        # A copy, for the function looks up the temperature that is replaced below.
        aero.standard_vatmos = FunctionType(aero.vatmos.__code__, dict(vars(aero)))

    def vatmos(altitude_m: Any) -> tuple[Any, Any, Any]:
        pressure, density, temperature = aero.standard_vatmos(altitude_m)
        return pressure, density * temperature / (temperature + warmer_k), temperature + warmer_k

    aero.vatmos = vatmos
    aero.vtemp = lambda altitude_m: vatmos(altitude_m)[2]


_COLUMNS = ("time_s", "altitude", "IAS", "Mach", "TAS", "groundspeed", "vertical_rate", "track", "heading")
_PLACE = ("latitude", "longitude")


def _state(rows: Array, plan: FlightPlan, warmer_k: float) -> dict[str, Array]:
    """Columns of one flight's states, from its first level on."""
    seen = rows[rows[:, 1] <= plan.top_fl * 100.0]
    state = {name: seen[:, i] for i, name in enumerate((*_COLUMNS, *_PLACE))}
    state["time_s"] = state["time_s"] - state["time_s"][0]
    # BlueSky's altitude is that of the pressure; what satellites would measure follows from the temperature.
    height_m = geometric_altitude_m(torch.from_numpy(state["altitude"] * FT_M), warmer_k)
    state["geoaltitude"] = height_m.numpy() / FT_M
    return state


class _Fleet:
    """Flights side by side, and the commands that they are under."""

    def __init__(self, bluesky: Any, plans: Sequence[FlightPlan], orders: Orders) -> None:
        self.sim, self.traf, self.stack = bluesky.sim, bluesky.traf, bluesky.stack
        self.plans, self.orders = plans, orders
        self.down = np.zeros(len(plans), dtype=bool)
        spread = orders.rate_spread * np.random.default_rng(orders.seed).standard_normal(len(plans))
        self.own = np.exp(spread - orders.rate_spread**2 / 2)
        self.on_cas = [False] * len(plans)
        self.level = [0] * len(plans)
        self.cas_kt = [plan.cas_kt + orders.faster_kt for plan in plans]
        self._order(f"DT {STEP_S}")
        if orders.wind_kt is not None:
            pairs = zip(orders.wind_kt.levels_fl, orders.wind_kt.values, strict=True)
            self._order("WIND 0 0 " + " ".join(f"{fl * 100:.0f} {_from(kt)} {abs(kt):.3f}" for fl, kt in pairs))
        for i, plan in enumerate(plans):
            high = plan.top_fl + ABOVE_FL
            speed = f"{plan.mach:.4f}" if self._is_mach(i, high) else f"{self.cas_kt[i]:.2f}"
            self._order(f"CRE F{i} {plan.typecode} {i * 0.5 - 40} 0 90 FL{high:.0f} {speed}")
        self.advance(STEP_S)
        if self.traf.ntraf != len(plans):
            raise DataError(f"{self.traf.ntraf} of {len(plans)} flights created", expected="all", mend="see its log")

    @property
    def time_s(self) -> float:
        return float(self.sim.simt)

    def advance(self, seconds: float) -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            for _ in range(round(seconds / STEP_S)):
                self.sim.step()

    def command(self) -> None:
        """Speeds where Mach hands over to CAS; altitudes and rates where a flight has come down by a step."""
        levels = self.traf.alt / FT_M / 100.0
        for i in np.flatnonzero(~self.down):
            level, plan, name = float(levels[i]), self.plans[i], f"F{i}"
            first = self.level[i] == 0
            if first or (not self.on_cas[i] and not self._is_mach(i, level)):
                mach = self._is_mach(i, level)
                self.on_cas[i] = not mach
                self._order(f"SPD {name} {plan.mach:.4f}" if mach else f"SPD {name} {self.cas_kt[i]:.2f}")
            if first or round(level / 5) != self.level[i]:
                self._altitude(name, level, plan, first)
                if self.orders.rates_fpm is not None:
                    rate = self.orders.rates_fpm.at(level) * self.own[i]
                    self._order(f"VS {name} {rate:.0f}")
                self.level[i] = max(round(level / 5), 1)

    def _altitude(self, name: str, level: float, plan: FlightPlan, first: bool) -> None:
        lowest = (plan.bottom_fl - ABOVE_FL) * 100.0
        if self.orders.step_ft is not None:
            self._order(f"ALT {name} {max(level * 100.0 - self.orders.step_ft, lowest):.0f}")
        elif first:
            self._order(f"ALT {name} {lowest:.0f}")

    def states(self) -> Array:
        """(columns, flights) now."""
        t = self.traf
        return np.stack(
            [
                np.full(t.ntraf, self.time_s),
                t.alt / FT_M,
                t.cas / KT_MPS,
                t.M,
                t.tas / KT_MPS,
                t.gs / KT_MPS,
                t.vs / FPM_MPS,
                t.trk,
                t.hdg,
                t.lat,
                t.lon,
            ]
        )

    def land(self) -> None:
        """Note who has reached the lowest level."""
        lowest = np.array([plan.bottom_fl * 100.0 for plan in self.plans])
        self.down |= self.traf.alt / FT_M <= lowest

    def _is_mach(self, i: int, level_fl: float) -> bool:
        """Test for a Mach number that is the lower of the two speeds at a level."""
        mach = self.plans[i].mach
        return bool(np.isfinite(mach)) and cas_of_mach_kt(mach, level_fl) < self.cas_kt[i]

    def _order(self, text: str) -> None:
        self.stack.stack(text)


def _from(tailwind_kt: float) -> int:
    """Direction from which a wind blows, degrees."""
    return WIND_FROM_BEHIND_DEG if tailwind_kt >= 0 else (WIND_FROM_BEHIND_DEG + 180) % 360


def _check_types(bluesky: Any, plans: Sequence[FlightPlan]) -> None:
    known = {str(name).upper() for name in bluesky.traf.perf.coeff.actypes_fixwing}
    strange = sorted({plan.typecode for plan in plans} - known)
    if strange:
        raise DataError(
            f"types {', '.join(strange)}, which BlueSky would fly as a B744",
            expected=f"some of {', '.join(sorted(known))}",
            mend="choose with --typecode",
        )
