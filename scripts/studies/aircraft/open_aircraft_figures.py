"""The nominal descent of an open aircraft next to the kinematic ranges published for its type."""

import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from descentflow.aircraft_types.open_types.open_aircraft import OpenType, open_aircraft, open_type
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.physics.airspeed import mach_to_cas_mps
from descentflow.physics.nominal_descent import NominalDescent, nominal_descent

BOTTOM_FL = 15
"""1,500 ft: the foot of the usual descent table."""
TOP_FL = 390
"""Highest level drawn, the paper's highest."""
_SCHEDULE_FL = 100
"""Below this the speed limit rules and no range is published."""
_COLOURS = ("#0072b2", "#000000", "#d55e00")
_STYLES = ("--", "-", "-.")
_RANGE = "#f0e442"


def open_aircraft_figure(typecode: str) -> Figure:
    """Rate, CAS, drag and thrust of the nominal descent against flight level, for three masses.

    The masses are BADA's low mass (1.2 times the minimum), the reference mass and the maximum landing mass; still air,
    standard atmosphere. Published ranges are shaded where they hold: of Mach and its rate above the transition, of CAS
    and its rate from there down to FL100, with their middle as a dotted line.

    Args:
        typecode: ICAO type designator of an open aircraft.

    Returns:
        A figure of four panels that share the flight level.

    Raises:
        AircraftError: If the type is not among the open ones.

    Example:
        >>> len(open_aircraft_figure("A320").axes)
        4
    """
    read, aircraft = open_type(typecode), open_aircraft(typecode)
    levels_fl = torch.arange(BOTTOM_FL, min(TOP_FL, float(aircraft.altitude_maximum_ft) / 100) + 1)
    masses_kg = descent_masses_kg(typecode)
    descent = nominal_descent(aircraft, levels_fl, torch.tensor(masses_kg, dtype=torch.float64))
    figure = Figure(figsize=(11.0, 5.2), layout="constrained")
    axes = figure.subplots(1, 4, sharey=True)
    _draw_ranges(axes, read, float(levels_fl[-1]))
    _draw_descents(axes, descent, masses_kg)
    _label(axes, typecode, float(levels_fl[-1]))
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=9)
    return figure


def descent_masses_kg(typecode: str) -> tuple[float, float, float]:
    """Low, reference and maximum landing mass of an open aircraft.

    Args:
        typecode: ICAO type designator.

    Returns:
        Three masses, ascending.

    Example:
        >>> descent_masses_kg("A320")
        (49554.0, 61300.0, 64875.0)
    """
    aircraft = open_aircraft(typecode)
    landing = next(f.value for f in open_type(typecode).facts if f.name == "mass_landing_kg")
    assert isinstance(landing, float)
    return round(1.2 * float(aircraft.mass_minimum_kg), 1), float(aircraft.mass_reference_kg), landing


def _draw_descents(axes: list[Axes], descent: NominalDescent, masses_kg: tuple[float, ...]) -> None:
    level = descent.level_fl
    for i, (mass_kg, name) in enumerate(zip(masses_kg, ("low", "reference", "landing"), strict=True)):
        fields = (
            -descent.rate_mps[i] / FPM_MPS,
            descent.cas_mps[i] / KT_MPS,
            descent.drag_n[i] / 1000,
            descent.thrust_n[i] / 1000,
        )
        for ax, field in zip(axes, fields, strict=True):
            label = f"{name} mass, {mass_kg / 1000:.1f} t"
            ax.plot(field, level, label=label, color=_COLOURS[i], linestyle=_STYLES[i], linewidth=1.6)


def _draw_ranges(axes: list[Axes], read: OpenType, top_fl: float) -> None:
    """Shade what is published, where it holds."""
    ranges = {e.name: e.value for e in read.published if isinstance(e.value, tuple)}
    transition_fl = float(open_aircraft(read.typecode).transition_altitude_m()) / FL_M
    legs = {"mach": (transition_fl, top_fl), "cas": (_SCHEDULE_FL, min(transition_fl, top_fl))}
    for name, (axis, leg) in {
        "rate_constant_mach_fpm": (axes[0], "mach"),
        "rate_constant_cas_fpm": (axes[0], "cas"),
        "mach": (axes[1], "mach"),
        "cas_kt": (axes[1], "cas"),
    }.items():
        bottom, top = legs[leg]
        if name in ranges and bottom < top:
            level = torch.linspace(bottom, top, 40, dtype=torch.float64)
            middle, low, high = (_as_drawn(name, value, level) for value in ranges[name])
            named = name == "rate_constant_cas_fpm"
            axis.fill_betweenx(level, low, high, color=_RANGE, alpha=0.45, linewidth=0, label="published range" * named)
            axis.plot(middle, level, color="#8a7d00", linestyle=":", linewidth=1.6, label="its middle" * named)


def _as_drawn(name: str, value: float, level_fl: Tensor) -> Tensor:
    """A published value along a leg, in the unit of the axis."""
    if name == "mach":
        return mach_to_cas_mps(value, level_fl * FL_M) / KT_MPS
    return torch.full_like(level_fl, -value if name.startswith("rate") else value)


def _label(axes: list[Axes], typecode: str, top_fl: float) -> None:
    names = ("Rate of descent (ft/min)", "Calibrated airspeed (kt)", "Drag (kN)", "Thrust (kN)")
    for ax, name in zip(axes, names, strict=True):
        ax.set_xlabel(name)
        ax.grid(color="#dddddd", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.set_ylim(0, top_fl)
    for ax in (axes[0], axes[2], axes[3]):
        ax.set_xlim(left=0)
    axes[0].set_ylabel("Flight level")
    axes[0].set_title(f"{typecode}, nominal descent", loc="left", fontsize=11, fontweight="bold")
