"""Every number that the diagnosis assumes, with what it means and where it comes from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

ROUNDING = {"rate": 0.01, "lag": 0.005, "cas": 0.3, "mismatch": 0.5, "tas": 0.002, "wind": 0.4}
"""Standard error of one report by the steps of Mode S fields (1 kt, Mach 0.004, 2 kt, 32 ft/min, over the root of 12),
in each quantity's unit."""


@dataclass(frozen=True)
class Assumptions:
    """Constants of the inference.

    Attributes:
        inclusion: Prior probability that an effect is among the causes: one of some fifteen is expected.
        prior_scales: Prior standard deviation of a parameter, in sizes that matter (``Parameter.scale``).
        kinematic_misfit: Share of its own shift by which an effect's equation may be off in speeds and heights, which
            rest on the atmosphere alone; of the rate it is the effect's own ``misfit_of_rate``.
        length_m: Height over which misfits and unknown causes change (6,000 ft): a third of a descent's levels.
        unknown_scales: Sizes of an unknown cause, in negligible shifts, among which the likeliest is taken: from
            barely more than negligible to 12 % of the rate.
        layers: Scale up to which what measures the air is free in every set: layers of 1.5 K, 0.6 m/s and 6 m, as the
            mean of some days has them beside a temperature or a wind gradient.
        named: Probability from which an effect, or a group of them, is named.
        alike: Ratio of weights from which one member of a scale group stands alone: polars of other aircraft decide
            smaller ratios, and no flight does.
        least_shift: Smallest shift of a mean that an effect is named by, in negligible shifts.
        rounding: See :data:`ROUNDING`.
        flight_size_error: Relative standard error of the mean shift of an effect that single flights show.
        odd: Standard deviations of ln rate of flights with a smooth departure of their own.
        white: Standard deviation of ln rate in each band that no law of a flight covers.
        wider: Grid of standard deviations of ln rate by which flights of a side may differ beyond the simulator's.
        short: Height over which the faster part of that changes, as a share of ``length_m``.
        noise_matters: Ratio of short-scale noise, as a logarithm, that is reported of a simulator.

    Example:
        >>> Assumptions().inclusion < 0.1
        True
    """

    inclusion: float = 1.0 / 15.0
    prior_scales: float = 3.0
    kinematic_misfit: float = 0.03
    length_m: float = 1800.0
    unknown_scales: tuple[float, ...] = (2.0, 6.0, 20.0, 60.0)
    layers: float = 6.0
    named: float = 0.95
    alike: float = 100.0
    least_shift: float = 1.5
    rounding: Mapping[str, float] = field(default_factory=lambda: MappingProxyType(ROUNDING))
    flight_size_error: float = 0.2
    odd: tuple[float, ...] = (0.03, 0.10)
    white: float = 0.01
    wider: tuple[float, ...] = (0.0, 0.015, 0.03, 0.06, 0.12)
    short: float = 1.0 / 3.0
    noise_matters: float = 0.3
