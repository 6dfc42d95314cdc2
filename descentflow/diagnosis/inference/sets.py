r"""Evidence of sets of effects, with or without an unknown cause besides them, and the search for the heaviest.

For a set M, about the sizes at which it is most probable,

.. math:: d \sim N\Big(0,\; V + \sum_{e \in M}\big(J_e P_e J_e^\top + F_e\big) + U\Big), \qquad
   U = \sum_q a_q^2\, \nu_q \nu_q^\top \circ K, \qquad
   w_M \propto Z_M \Big(\frac{\pi}{1-\pi}\Big)^{|M| + |\{q: a_q \ne 0\}|}.

An unknown cause is a free smooth process in a quantity of altitude, each quantity with one of its own: to move several
alike is what effects do. Its scales :math:`a_q` are the likeliest of a short grid; each that is not zero costs the
logarithm of the grid's length. What the air alone moves (TAS over that of
the Mach number, wind, geometric height) is free in every set up to a scale: layers of air that the simulator lacks are
no cause.

All sets of up to three effects are screened, each effect linear about the size that it has alone; the heaviest are
fitted, and the best of them grown by further effects while that makes it heavier.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from descentflow.core.linear_gaussian import Array, GaussianPosterior, posterior
from descentflow.diagnosis.inference.candidates import Candidate
from descentflow.diagnosis.inference.moments import Moments
from descentflow.diagnosis.inference.signatures import Signature, linearised
from descentflow.diagnosis.sides.assumptions import Assumptions
from descentflow.measurements.quantity_registry import QUANTITIES

GAUSS_NEWTON_ROUNDS = 4
"""Rounds of Gauss-Newton: shifts are nearly linear in their sizes."""
SCALE_SWEEPS = 2
"""Sweeps over the quantities, of which an unknown cause moves some."""

OF_AIR = ("tas", "wind", "height")
"""Quantities that measure the air."""

Names = tuple[str, ...]


@dataclass(frozen=True)
class SetFit:
    """A set of effects at its most probable sizes.

    Attributes:
        names: Of its effects.
        sizes: (k,) of each.
        errors: (k,) standard errors of these.
        shifts: (p,) of each.
        log_weight: Evidence and prior, nats, up to a constant.
        unknown: Scale of an unknown cause by quantity, in negligible shifts; empty for none.
        noise: (p, p) covariance of what is left once the shifts are taken off.

    Example:
        >>> SetFit((), {}, {}, {}, -3.0, {}, np.eye(2)).is_null
        True
    """

    names: Names
    sizes: Mapping[str, Array]
    errors: Mapping[str, Array]
    shifts: Mapping[str, Array]
    log_weight: float
    unknown: Mapping[str, float]
    noise: Array = field(repr=False)
    air: frozenset[str] = frozenset()
    """Quantities of ``unknown`` that layers of air explain."""

    @property
    def is_null(self) -> bool:
        """True if it has neither effects nor an unknown cause."""
        return not self.names and not self.has_unknown

    @property
    def has_unknown(self) -> bool:
        """True if an unknown cause moves more than what measures the air."""
        return not self.air.issuperset(self.unknown)

    @property
    def shift(self) -> Array:
        """(p,) of all its effects."""
        return sum(self.shifts.values(), np.zeros(len(self.noise)))


class SetFits:
    """Fits of sets of some candidates to the difference of two sides.

    Example:
        >>> from descentflow.diagnosis.inference.candidates import FlightsEffect
        >>> import torch
        >>> names = np.array(["rate", "rate"])
        >>> known = Moments(np.array([0.5, 0.5]), np.eye(2) / 100, np.zeros((1, 2)), np.full(2, 0.01), names, np.eye(2))
        >>> brakes = FlightsEffect("speed_brake", torch.zeros(1), np.ones((2, 1)), 0.0, 0 * np.eye(2), np.array([0.2]))
        >>> fitted = SetFits(known, [brakes], Assumptions()).fit(("speed_brake",))
        >>> fitted.sizes["speed_brake"].round(2)  # between 0.5, as seen, and 1, as expected
        array([0.56])
    """

    def __init__(
        self,
        known: Moments,
        candidates: Sequence[Candidate],
        assumed: Assumptions,
        *,
        linear_about: Mapping[str, Array] | None = None,
    ) -> None:
        """Take the candidates.

        Args:
            known: Moments of both sides.
            candidates: Effects that may be causes.
            assumed: Constants.
            linear_about: Sizes by candidate about which all is linear; each is linearised at every size if absent.
        """
        self.known, self.assumed = known, assumed
        self.candidates = {candidate.name: candidate for candidate in candidates}
        self._about = {name: (sizes, self.candidates[name].at(sizes)) for name, sizes in (linear_about or {}).items()}
        self._log_odds = math.log(assumed.inclusion / (1.0 - assumed.inclusion))
        self._log_grid = math.log(len(assumed.unknown_scales) + 1.0)

    def fit(
        self,
        names: Names,
        unknown: Mapping[str, float] | None = None,
        first: Mapping[str, Array] | None = None,
        rounds: int = GAUSS_NEWTON_ROUNDS,
        *,
        is_exact: bool = False,
    ) -> SetFit:
        """Fit a set.

        Args:
            names: Of the effects.
            unknown: Scales of an unknown cause.
            first: Sizes at which to begin.
            rounds: Number of Gauss-Newton steps.
            is_exact: Whether sizes are those that make the difference that is seen where they are put into the
                simulator's flights, with these equations and these coefficients, whatever either may miss.
        """
        scales, begin = dict(unknown or {}), first or {}
        sizes = {name: begin.get(name, self.candidates[name].start) for name in names}
        for done in range(rounds):
            refined, _ = self._step(sizes, scales, is_exact)
            # A misfit grows with its size, so sizes can leap about the solution: after the first step by half the way.
            share = 0.5 if done else 1.0
            for name, part in zip(names, self._split(names, refined.mean), strict=True):
                sizes[name] = self.candidates[name].clamp(sizes[name] + share * (part - sizes[name]))
        last, noise = self._step(sizes, scales, is_exact)
        gained = sum(self.candidates[name].log_gain for name in names)
        errors = self._split(names, np.sqrt(np.maximum(last.covariance.diagonal(), 0.0)))
        shifts = {name: self._signature(name, sizes[name]).shift for name in names}
        weight = last.log_evidence + gained + self._log_odds * len(names) + self._log_prior(scales)
        return SetFit(
            names, sizes, dict(zip(names, errors, strict=True)), shifts, weight, scales, noise, self._air(scales)
        )

    def unknown_covariance(self, scales: Mapping[str, float]) -> Array:
        """Covariance (p, p) of an unknown cause."""
        size = np.array([scales.get(name, 0.0) for name in self.known.quantity]) * self.known.negligible
        return np.outer(size, size) * self.known.kernel

    def unknown_scales(self, fit: SetFit, *, air: bool) -> dict[str, float]:
        """The likeliest scales with a set, one quantity after the other: of layers of air alone, or of everything."""
        rest, noise = self.known.difference - fit.shift, fit.noise - self.unknown_covariance(fit.unknown)
        for name in fit.names:
            candidate = self.candidates[name]
            jacobian = candidate.at(fit.sizes[name]).jacobian
            rest = rest + jacobian @ (fit.sizes[name] - candidate.start)
            noise = noise + (jacobian * candidate.prior_sd**2) @ jacobian.T
        every = [name for name in dict.fromkeys(map(str, self.known.quantity)) if QUANTITIES[name].by_band]
        quantities = [name for name in every if name in OF_AIR] if air else every
        sizes = [scale for scale in self.assumed.unknown_scales if not air or scale <= self.assumed.layers]

        @cache
        def score(*chosen: tuple[str, float]) -> float:
            return evidence(rest, noise + self.unknown_covariance(dict(chosen))) + self._log_prior(dict(chosen))

        scales = dict(fit.unknown)
        for _, name in itertools.product(range(SCALE_SWEEPS), quantities):
            others = {other: scale for other, scale in scales.items() if other != name}
            tries = [others, *({**others, name: scale} for scale in sizes)]
            scales = max(tries, key=lambda scales: score(*sorted(scales.items())))
        return scales

    def _air(self, scales: Mapping[str, float]) -> frozenset[str]:
        """Quantities that layers of air move."""
        return frozenset(q for q, scale in scales.items() if q in OF_AIR and scale <= self.assumed.layers)

    def _log_prior(self, scales: Mapping[str, float]) -> float:
        """Of an unknown cause in these quantities."""
        causes = len(scales) - len(self._air(scales))
        return self._log_odds * causes - self._log_grid * len(scales)

    def _signature(self, name: str, sizes: Array) -> Signature:
        """Signature of a candidate at sizes (k,)."""
        if name not in self._about:
            return self.candidates[name].at(sizes)
        first, about = self._about[name]
        return linearised(about, sizes - first)

    def _step(
        self, sizes: Mapping[str, Array], scales: Mapping[str, float], is_exact: bool
    ) -> tuple[GaussianPosterior, Array]:
        """Posterior about the linearisation at sizes, and the covariance of what its Jacobian leaves."""
        x, noise = self.known.difference, self.known.covariance + self.unknown_covariance(scales)
        columns, mean, spread = [np.zeros((len(x), 0))], [np.zeros(0)], [np.zeros(0)]
        for name, size in sizes.items():
            candidate = self.candidates[name]
            signature = self._signature(name, size)
            noise = noise + (0.0 if is_exact else signature.misfit + signature.unsure)
            x = x - signature.shift + signature.jacobian @ size
            columns.append(signature.jacobian)
            mean.append(candidate.start)
            spread.append(candidate.free_sd if is_exact else candidate.prior_sd)
        return posterior(x, noise, np.concatenate(columns, 1), np.concatenate(mean), np.concatenate(spread)), noise

    def _split(self, names: Names, values: Array) -> list[Array]:
        ends = np.cumsum([len(self.candidates[name].start) for name in names])
        return np.split(values, ends[:-1]) if names else []


def evidence(x: Array, covariance: Array) -> float:
    """Log density of a normal law of mean zero.

    Example:
        >>> round(evidence(np.zeros(1), np.eye(1)), 3)
        -0.919
    """
    none = np.zeros(0)
    return posterior(x, covariance, np.zeros((len(x), 0)), none, none).log_evidence


MOST_ENUMERATED = 3
"""Effects of the sets that are all screened; larger ones are grown."""
MOST_FITTED = 20
"""Sets that are fitted; half as many with an unknown cause besides them."""


class Search:
    """All sets of a catalogue's effects: a linear fit screens every small one, and whole fits weigh the heaviest."""

    def __init__(
        self,
        known: Moments,
        candidates: Sequence[Candidate],
        assumed: Assumptions,
        exclusive: Sequence[Sequence[str]] = (),
    ) -> None:
        """Linearise every candidate at the size that it has alone.

        Args:
            known: Moments of both sides.
            candidates: Effects that may be causes.
            assumed: Constants.
            exclusive: Groups of names of which a set has one at most.
        """
        self.known, self.assumed, self.exclusive = known, assumed, [set(group) for group in exclusive]
        self.fits = SetFits(known, candidates, assumed)
        self._alone = {one.name: self.fits.fit((one.name,)).sizes[one.name] for one in candidates}
        self._linear_fits = SetFits(known, candidates, assumed, linear_about=self._alone)

    def sized(self, fit: SetFit) -> SetFit:
        """A set with the sizes that make the difference by these equations; errors stay those of all they may miss."""
        sized = self.fits.fit(fit.names, fit.unknown, fit.sizes, is_exact=True)
        return replace(fit, sizes=sized.sizes, shifts=sized.shifts)

    def sets(self) -> list[SetFit]:
        """The sets that matter, at plausible sizes, heaviest first."""
        fitted = {}
        for names in self._heaviest():
            fitted[names] = self.fits.fit(names, first=self._alone)
        self._grow(fitted)
        ordered = sorted(fitted.values(), key=lambda fit: -fit.log_weight)
        small = [fit for fit in ordered if len(fit.names) <= 1]
        for kept in {fit.names: fit for fit in (*ordered[: MOST_FITTED // 2], *small[: MOST_FITTED // 2])}.values():
            in_air = self._with_unknown(kept, air=True)
            ordered += [in_air, self._with_unknown(in_air, air=False)]
        by_content = {(fit.names, *fit.unknown.items()): fit for fit in filter(self.plausible, ordered)}
        return sorted(by_content.values(), key=lambda fit: -fit.log_weight)

    def _with_unknown(self, fit: SetFit, *, air: bool) -> SetFit:
        """A set with what else is likeliest to move the means; itself where nothing does."""
        scales = self.fits.unknown_scales(fit, air=air)
        return fit if scales == fit.unknown else self.fits.fit(fit.names, scales, fit.sizes)

    def plausible(self, fit: SetFit) -> bool:
        """True if every effect may have its size, and moves some mean by more than what is negligible."""
        for name in fit.names:
            moved = np.abs(fit.shifts[name] / self.known.negligible).max()
            if moved < self.assumed.least_shift or not self.fits.candidates[name].plausible(fit.sizes[name]):
                return False
        return True

    def _allowed(self, names: Sequence[str]) -> bool:
        return all(len(group.intersection(names)) <= 1 for group in self.exclusive)

    def _heaviest(self) -> list[Names]:
        """Sets that weigh most where all is linear, and the empty one."""
        every = (itertools.combinations(self.fits.candidates, count) for count in range(MOST_ENUMERATED + 1))
        allowed = [names for names in itertools.chain(*every) if self._allowed(names)]
        weight = {names: self._linear_fits.fit(names, first=self._alone, rounds=1).log_weight for names in allowed}
        return list(dict.fromkeys([*sorted(allowed, key=lambda names: -weight[names])[:MOST_FITTED], ()]))

    def _grow(self, fitted: dict[Names, SetFit]) -> None:
        """Add the best further effect to the heaviest set, as long as that makes it heavier."""
        while True:
            best = max(fitted.values(), key=lambda fit: fit.log_weight)
            if len(best.names) < MOST_ENUMERATED:
                return
            larger = [(*best.names, name) for name in self.fits.candidates if name not in best.names]
            first = {**self._alone, **best.sizes}
            grown = [self.fits.fit(names, first=first) for names in larger if self._allowed(names)]
            heavier = [fit for fit in grown if fit.log_weight > best.log_weight and self.plausible(fit)]
            if not heavier:
                return
            top = max(heavier, key=lambda fit: fit.log_weight)
            fitted[top.names] = top
