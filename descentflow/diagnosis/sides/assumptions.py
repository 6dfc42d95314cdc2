"""Every number that a diagnosis assumes: its meaning, its unit, where it comes from.

Numbers that only say how exactly something is computed (rounds, steps of derivatives, lengths of lists) stand next to
the code that computes it. `python scripts/vary_assumptions.py REAL SIMULATOR` halves and doubles each of these on
flights of your own, and prints what moves.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from descentflow.diagnosis.findings.gap_found import FALSE_GAP
from descentflow.measurements.quantity_registry import QUANTITIES

ROUNDING = {"rate": 0.01, "lag": 0.005, "cas": 0.3, "mismatch": 0.5, "tas": 0.002, "wind": 0.4}
"""Standard error of one report by the steps of Mode S fields (1 kt, Mach 0.004, 2 kt, 32 ft/min, over the root of 12),
in each quantity's unit."""
NEGLIGIBLE = {
    "rate": 0.002,
    "lag": 0.002,
    "cas": 0.5,
    "mismatch": 0.1,
    "tas": 0.0005,
    "wind": 0.1,
    "height": 1.0,
    "noise": 0.03,
    "level": 2.0,
    "level_gaps": 0.03,
    "slow": 2.0,
    "missing": 0.005,
}
"""Shifts of a mean that mean nothing in practice, in each quantity's unit: what equations leave out, and no more."""


@dataclass(frozen=True)
class Assumptions:
    """Constants of a diagnosis.

    Attributes:
        inclusion: Prior probability that an effect is among the causes: one of some fifteen is expected.
        prior_scales: Prior standard deviation of a parameter, in sizes that matter (``Parameter.scale``).
        kinematic_misfit: Share of its own shift by which an effect's equation may be off in speeds and heights, which
            rest on the atmosphere alone; of the rate it is the effect's own ``misfit_of_rate``.
        length_m: Height over which misfits and unknown causes change (6,000 ft): a third of a descent's levels.
        unknown_scales: Sizes of an unknown cause, in negligible shifts, among which the likeliest is taken: from
            barely more than negligible to 12 % of the rate.
        layers: Scale up to which what measures the air is free in every set: layers of 1.5 K, 0.6 m/s and 6 m, as the
            mean of some days has them next to a temperature or a wind gradient.
        named: Probability from which an effect, or a group of them, is named: that of the intervals of its sizes.
        alike: Ratio of weights from which one member of a scale group stands alone: polars of other aircraft decide
            smaller ratios, and no flight does.
        least_shift: Smallest shift of a mean that an effect is named by, in negligible shifts.
        least_shown: Probability below which an effect is not looked at.
        negligible: See :data:`NEGLIGIBLE`.
        rounding: See :data:`ROUNDING`.
        settled_m: Rates are compared from so far below a flight's highest level: above it, they are of how a descent
            begins, and how late a report is shows as much as how steep the descent is.
        extreme: Robust standard deviations to which values are drawn in: one misread flight must not decide.
        edge_noise: Variance of the change of a rate over a band by its noise, in squares of the short-scale noise:
            means of a few reports at either edge, each of which serves several levels.
        coefficient_spread: Prior standard deviations of ln mass, ln CD0, ln CD2 and ln idle thrust. Mass: between the
            operating empty and the maximum landing mass of a jet (A320: 41 to 65 t about 55 t), even odds. CD0: root
            mean square difference of OpenAP's and Poll-Schumann's of six jets (3 % for the A320, a factor of two for
            the B772), over the root of two. CD2: the same (4 to 9 %), with winglets or without. Idle: 2 % of climb
            thrust, between none and OpenAP's 7 %.
        equation_spread: Prior standard deviation of what the equations miss of ln rate in every flight alike, half of
            it alike in all bands. Six-degree-of-freedom flights of four types against open coefficients of another
            type leave 0.06 to 0.12 root mean square over their bands; flights of these equations 0.01.
        flight_size_error: Relative standard error of the mean shift of an effect that single flights show.
        least_share: Share of the flights, beyond the simulator's, from which an effect of some flights is one.
        law_flights: Flights' worth of the law from which EM starts, in each step of it.
        odd: Standard deviations of ln rate of flights with a smooth departure of their own.
        white: Standard deviation of ln rate in each band that no law of a flight covers.
        wider: Grid of standard deviations of ln rate by which flights of a side may differ beyond the simulator's.
        short: Height over which the faster part of that changes, as a share of ``length_m``.
        noise_matters: Ratio of short-scale noise, as a logarithm, that is reported of a simulator.
        usual_level_offs: Prior size of a lack of level-offs, in negligible shifts.
        false_gap: p-value up to which a gap is called: 2 of 100 comparisons without one; five would be too many.
        false_cells: Chance that any cell of quantity and altitude is called where there is no gap.

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
    named: float = 0.9
    alike: float = 100.0
    least_shift: float = 1.5
    least_shown: float = 0.02
    negligible: Mapping[str, float] = field(default_factory=lambda: MappingProxyType(NEGLIGIBLE))
    rounding: Mapping[str, float] = field(default_factory=lambda: MappingProxyType(ROUNDING))
    settled_m: float = 300.0
    extreme: float = 6.0
    edge_noise: float = 0.7
    coefficient_spread: tuple[float, ...] = (0.12, 0.23, 0.10, 0.80)
    equation_spread: float = 0.10
    flight_size_error: float = 0.2
    least_share: float = 0.05
    law_flights: float = 2.0
    odd: tuple[float, ...] = (0.03, 0.10)
    white: float = 0.01
    wider: tuple[float, ...] = (0.0, 0.015, 0.03, 0.06, 0.12)
    short: float = 1.0 / 3.0
    noise_matters: float = 0.3
    usual_level_offs: float = 15.0
    false_gap: float = FALSE_GAP
    false_cells: float = 0.05

    def negligible_shift(self, quantity: str) -> float:
        """Shift of a quantity's mean that means nothing in practice, in its unit.

        Example:
            >>> Assumptions().negligible_shift("noise_cas")
            0.03
        """
        return self.negligible["noise" if QUANTITIES[quantity].is_noise else quantity]


ASSUMED = Assumptions()
"""The usual ones."""
