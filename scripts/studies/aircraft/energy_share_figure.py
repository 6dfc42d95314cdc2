"""Figure of BADA's energy share factor: the same drag and CAS flown with it, with the exact one, and in wind."""

from collections.abc import Iterable

import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.physics.airspeed import mach_to_cas_mps
from descentflow.physics.idle_state import idle_state
from descentflow.physics.performance_model import PerformanceModel
from descentflow.reporting.figure_style import BLACK, BLUE, RED, legend_below, panels
from descentflow.representation.decoder.trajectories import Trajectories, integrate

_LEVELS_FL = torch.arange(150, 371, dtype=torch.float64)
WIND_KT_PER_1000_FT = 2.0
"""Growth of the tailwind with altitude in the windy case."""


def energy_share_figure(
    aircraft: PerformanceModel, mach: float = 0.78, cas_kt: float = 300.0, slower_kt: float = 260.0
) -> Figure:
    """CAS, rate and time of one descent at BADA's, the exact, and the exact energy share factor in a tailwind.

    The flight holds its own Mach number, then its own CAS, and slows down between FL220 and FL200. Its crossover is not
    the type's, so between the two BADA takes the factor of the other leg; through the slowdown that of held CAS.

    Args:
        aircraft: Coefficients of the type.
        mach: Mach number held at first.
        cas_kt: CAS held then.
        slower_kt: CAS below the slowdown.

    Returns:
        A figure of three panels that share the flight level.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> len(energy_share_figure(open_aircraft("A320")).axes)
        3
    """
    altitude_m = _LEVELS_FL * FL_M
    cas_mps = speed_profile(altitude_m, mach, cas_kt, slower_kt)[None]
    drag = aircraft.drag_n(idle_state(aircraft, cas_mps, altitude_m).tas_mps, altitude_m)
    wind_mps = WIND_KT_PER_1000_FT * KT_MPS / (10 * FL_M) * altitude_m
    entry = torch.tensor([len(_LEVELS_FL) - 1])

    def fly(wind: Tensor | None, exact: bool) -> Trajectories:
        arguments = (aircraft, _LEVELS_FL, altitude_m, drag, cas_mps, entry)
        return integrate(*arguments, wind_mps=wind, exact_energy_share=exact)

    flown = {
        "BADA's factor (the default)": (fly(None, False), BLACK, "-"),
        "exact factor": (fly(None, True), BLUE, "--"),
        f"exact, tailwind growing {WIND_KT_PER_1000_FT:g} kt per 1,000 ft": (fly(wind_mps, True), RED, "-."),
    }
    figure, (axes,) = panels(10.0, 4.4, 1, 3, sharey=True)
    for name, (curve, colour, style) in flown.items():
        _draw(axes, curve, name, colour, style)
    axes[0].set(xlabel="Calibrated airspeed (kt)", ylabel="Flight level")
    axes[1].set(xlabel="Rate of descent (ft/min)")
    axes[2].set(xlabel="Time since FL370 (min)")
    legend_below(figure, axes)
    return figure


def speed_profile(altitude_m: Tensor, mach: float, cas_kt: float, slower_kt: float) -> Tensor:
    """CAS (L,) in m/s of a Mach number, then a CAS, then a straight slowdown between FL220 and FL200 to another.

    Example:
        >>> speeds = speed_profile(torch.tensor([200.0, 300.0, 370.0]) * FL_M, mach=0.78, cas_kt=300.0, slower_kt=260.0)
        >>> [round(kt) for kt in (speeds / KT_MPS).tolist()]
        [260, 296, 252]
    """
    held = torch.minimum(mach_to_cas_mps(mach, altitude_m), torch.full_like(altitude_m, cas_kt * KT_MPS))
    share = ((220 * FL_M - altitude_m) / (20 * FL_M)).clamp(0, 1)
    return held + share * (slower_kt * KT_MPS - held)


def _draw(axes: Iterable[Axes], flown: Trajectories, name: str, colour: str, style: str) -> None:
    values = (flown.cas_mps / KT_MPS, -flown.rate_mps / FPM_MPS, flown.time_s / 60)
    for axis, value in zip(axes, values, strict=True):
        axis.plot(value[0].numpy(), flown.levels_fl.numpy(), color=colour, linestyle=style, label=name)
