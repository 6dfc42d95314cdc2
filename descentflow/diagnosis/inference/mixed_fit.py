"""Fits that mix effects alike in all flights with effects that flights have each in their own way."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import FOLDS
from descentflow.diagnosis.inference.ascent import ascend
from descentflow.diagnosis.inference.flight_fit import MIN_TAKEN, FlightFit, Laws
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit, FlightShares
from descentflow.diagnosis.inference.linear_algebra import Design
from descentflow.diagnosis.inference.signature_columns import signature_columns
from descentflow.effects.flight_law import DiffersByFlight

MAX_ROUNDS = 4
"""Of effects that all flights have alike, and laws beside them, at most..."""
SETTLED = 0.02
"""...and the change of a parameter, in sizes that matter, below which no other round follows."""


def with_flight_laws(likelihood: EffectsLikelihood, fit: Fit) -> Fit:
    """The fit with the laws of those effects that differ by flight, where that scores higher; else as it is.

    What only some flights have shows in them one by one, and a mean shift of it in all is no cause that is believed
    (:func:`~descentflow.diagnosis.inference.credible.is_credible`). So where the mean shift is of some, laws need not
    score higher than it: among themselves they compete, and then with other causes.

    Args:
        likelihood: Of the flights.
        fit: Of effects whose mean shift all flights have.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> with_flight_laws(likelihood, fit_effects(likelihood, ["temperature"])).per_flight  # alike in all
        {}
    """
    able = {n: e for n in fit.theta if isinstance(e := likelihood.catalogue[n], DiffersByFlight)}
    if not any(differs_by_flight(likelihood, name) for name in able):
        return fit
    state, best = likelihood.compared.state, fit
    if any(is_of_some(likelihood, name, fit.theta[name]) for name in able):
        best = replace(fit, log_score=torch.full_like(fit.log_score, -torch.inf))
    for laws in product(*[effect.law_starts(state, fit.theta[name]) for name, effect in able.items()]):
        for tried in _rounds(likelihood, fit, dict(zip(able, laws, strict=True)), best):
            if float((tried.log_score - best.log_score).sum()) <= 0 or not _can_be(likelihood, tried):
                # Another round would move it by little.
                break
            best = tried
    return best if best.per_flight else fit


def is_of_some(likelihood: EffectsLikelihood, name: str, theta: Tensor) -> bool:
    """Whether an effect that flights have each in their own way is, by its parameters (k,), one of some of them.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> half, all_of_them = (torch.tensor([0.3, 200, 240, share, 0, 0, 0, 0]) for share in (0.5, 1.0))
        >>> [is_of_some(likelihood, "speed_brake", theta) for theta in (half, all_of_them)]
        [True, False]
    """
    return likelihood.catalogue[name].mixture(theta)[0] < 1 and differs_by_flight(likelihood, name)


def _can_be(likelihood: EffectsLikelihood, fit: Fit) -> bool:
    """Whether all laws of a fit are possible ones."""
    state = likelihood.compared.state
    return all(likelihood.catalogue[name].plausible(state, fit.theta[name]) for name in fit.per_flight)


def differs_by_flight(likelihood: EffectsLikelihood, name: str) -> bool:
    """Whether flights have an effect each in their own way, and what is compared would show it.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> [differs_by_flight(likelihood, name) for name in ("speed_brake", "temperature")]
        [True, False]
    """
    able = isinstance(likelihood.catalogue[name], DiffersByFlight)
    return able and likelihood.has_reference and len(likelihood.compared.columns("rate")) > 0


def _rounds(likelihood: EffectsLikelihood, fit: Fit, laws: Laws, best: Fit) -> Iterator[Fit]:
    """Fits with laws learnt from their start, after each round of these and of the effects beside them.

    Where one scores no higher than the best, its score may be too high by what odd flights of the simulator gain.
    """
    flights = FlightFit(likelihood, laws)
    alike = {name: theta for name, theta in fit.theta.items() if name not in laws}
    expected = expected_with(likelihood, fit.shift, likelihood.shift(alike))
    for _ in range(MAX_ROUNDS):
        flights.learn(expected[likelihood.real])
        cleaned = _cleaned(likelihood, flights)
        before, alike = alike, ascend(cleaned, alike)
        found = _mixed(likelihood, cleaned, flights, best, alike)
        yield found
        # Another round is asked for after a better fit alone.
        best = found
        if all(_is_settled(likelihood, name, before[name], theta) for name, theta in alike.items()):
            return
        shift = cleaned.shift(alike)
        expected = expected_with(cleaned, shift, shift)


def _mixed(
    likelihood: EffectsLikelihood,
    cleaned: EffectsLikelihood,
    flights: FlightFit,
    best: Fit,
    alike: Mapping[str, Tensor],
) -> Fit:
    """The fit of the laws, and of the effects beside them that all flights have alike; ``best`` so far of the same."""
    theta = {name: flights.laws[name] if name in flights.laws else alike[name] for name in best.theta}
    signatures, shares = signature_columns(likelihood, theta), flights.shares()
    shift, design = likelihood.shift(alike), cleaned.design(alike, signatures=signatures)
    return Fit(
        best.effects,
        theta,
        shift + flights.shift(),
        likelihood.kept(lambda: design_with_laws(likelihood, theta, shares)),
        _log_score(likelihood, cleaned, flights, shift, design, best.log_score),
        shares,
    )


def design_with_laws(
    likelihood: EffectsLikelihood, theta: Mapping[str, Tensor], shares: Mapping[str, FlightShares]
) -> Design:
    """Columns of effects, those that all flights have alike without entries that a held path or rate decides.

    Args:
        likelihood: Of the flights.
        theta: Parameters by effect.
        shares: What each flight has of those that differ by flight.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> design_with_laws(likelihood, {"temperature": torch.tensor([10.0]).double()}, {}).n_parameters
        1
    """
    held = _held_by(likelihood, shares)[likelihood.real][:, :, None]
    if not bool(held.any()):
        return likelihood.design(theta)
    own = {name: likelihood.real_jacobian(name, value) for name, value in theta.items()}
    moved = [torch.where(held & (name not in shares), 0.0, columns) for name, columns in own.items()]
    return likelihood.joined(moved, signature_columns(likelihood, theta))


def _is_settled(likelihood: EffectsLikelihood, name: str, before: Tensor, now: Tensor) -> bool:
    scale = torch.tensor([p.scale for p in likelihood.catalogue[name].parameters], dtype=now.dtype)
    return bool(((now - before).abs() <= SETTLED * scale).all())


def expected_with(likelihood: EffectsLikelihood, shift: Tensor, kept: Tensor) -> Tensor:
    """What is expected (n, p) of every flight with a part of a shift, where the whole of it is in the flights.

    Args:
        likelihood: Of the flights.
        shift: (n, p) of all effects.
        kept: (n, p) the part that what is expected has.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> shift = likelihood.shift({"temperature": torch.tensor([10.0]).double()})
        >>> apart = expected_with(likelihood, shift, shift) - expected_with(likelihood, shift, 0 * shift)
        >>> bool(torch.allclose(apart, shift))
        True
    """
    mean, step = likelihood.moments(likelihood.weighted_rest(shift), likelihood.design({})).solved()
    expected = likelihood.common.columns @ step + kept
    expected[:, likelihood.compared.free] += mean
    return expected


def _held_entries(likelihood: EffectsLikelihood, flights: FlightFit) -> Tensor:
    """Entries (n, p) that a path or rate decides and no effect that all flights have alike."""
    held = torch.zeros(len(likelihood.y), dtype=torch.bool)
    held[flights.at] = flights.holds_rate()
    return held[:, None] & likelihood.compared.of("rate")


def without_laws(likelihood: EffectsLikelihood, fit: Fit) -> EffectsLikelihood:
    """The likelihood of the flights without what a fit expects of laws, and without rates that are held by them.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.likelihood import FlightShares
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["speed_brake"], [0.4, 200, 240, 1, 0, 0, 0, 0])
        >>> own = FlightShares(torch.ones(160), {}, torch.full_like(likelihood.y, 0.1))
        >>> fit = replace(fit_effects(likelihood, ["speed_brake"]), per_flight={"speed_brake": own})
        >>> round(float((likelihood.compared.y - without_laws(likelihood, fit).compared.y).nanmean()), 3)
        0.1
    """
    shift = torch.zeros_like(likelihood.y)
    for own in fit.per_flight.values():
        shift = shift + own.shift
    return _without(likelihood, shift, _held_by(likelihood, fit.per_flight))


def _held_by(likelihood: EffectsLikelihood, shares: Mapping[str, FlightShares]) -> Tensor:
    """Entries (n, p) that a path or rate decides which flights hold, by what each has of the effects."""
    held = torch.zeros_like(likelihood.y, dtype=torch.bool)
    for name, own in shares.items():
        effect = likelihood.catalogue[name]
        if isinstance(effect, DiffersByFlight) and effect.holds_rate:
            held |= (own.share > MIN_TAKEN)[:, None] & likelihood.compared.of("rate")
    return held


def _cleaned(likelihood: EffectsLikelihood, flights: FlightFit) -> EffectsLikelihood:
    """The same while laws are learnt."""
    return _without(likelihood, flights.shift(), _held_entries(likelihood, flights))


def _without(likelihood: EffectsLikelihood, shift: Tensor, held: Tensor) -> EffectsLikelihood:
    """The likelihood of the flights without a shift (n, p) and without some entries (n, p)."""
    whitening, y = likelihood.whitening, torch.where(held, torch.nan, likelihood.compared.y - shift)
    if bool(held.any()):
        whitening = whitening.hiding(y.isfinite())
    compared = replace(likelihood.compared, y=y)
    return EffectsLikelihood(compared, whitening, likelihood.catalogue, 0, like=likelihood)


def _log_score(
    likelihood: EffectsLikelihood,
    cleaned: EffectsLikelihood,
    flights: FlightFit,
    shift: Tensor,
    design: Design,
    best: Tensor,
) -> Tensor:
    """Log score (n,) of each flight's mixture under mean, coefficients and laws of the other folds.

    A law may fit odd flights that the simulator's side has as well: what it would gain there is no difference between
    the sides, and is taken off (scaled to the number of real flights), where it scores above the best (n,) without.
    """
    expected = cleaned.y - cleaned.held_out_errors(shift, design)
    error = likelihood.y - expected
    score = -0.5 * (error * likelihood.whitening.apply(error)).sum(1)
    for k in range(FOLDS):
        mine = likelihood.fold[flights.at] == k
        at = flights.at[mine]
        if len(at):
            score[at] += flights.log_ratio(flights.learnt(~mine), error[at], expected[at], at)
    if float((score - best).sum()) <= 0:
        return score
    others = torch.nonzero(~likelihood.real)[:, 0]
    of_simulator = flights.log_ratio(flights.laws, error[others], expected[others], others)
    if float(of_simulator.sum()) > 0:
        score[others] -= len(flights.at) / len(others) * of_simulator
    return score
