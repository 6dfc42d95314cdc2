"""Fits that mix effects alike in all flights with effects that flights have each in their own way."""

from dataclasses import replace
from itertools import product

import torch
from torch import Tensor

from descentflow.diagnosis.inference.aircraft_groups import FOLDS
from descentflow.diagnosis.inference.ascent import ascend
from descentflow.diagnosis.inference.flight_fit import FlightFit, Laws
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.linear_algebra import Design
from descentflow.diagnosis.inference.signature_columns import signature_columns
from descentflow.effects.flight_law import DiffersByFlight

ROUNDS = 2
"""Of effects that all flights have alike, and laws beside them: each hardly moves the other."""


def with_flight_laws(likelihood: EffectsLikelihood, fit: Fit) -> Fit:
    """The fit with the laws of those effects that differ by flight, where that scores higher; else as it is.

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
    if not able or not likelihood.has_reference or not len(likelihood.compared.columns("rate")):
        return fit
    state, best = likelihood.compared.state, fit
    for laws in product(*[effect.law_starts(state, fit.theta[name]) for name, effect in able.items()]):
        tried = _fitted(likelihood, fit, dict(zip(able, laws, strict=True)))
        if float((tried.log_score - best.log_score).sum()) > 0:
            best = tried
    return best


def _fitted(likelihood: EffectsLikelihood, fit: Fit, laws: Laws) -> Fit:
    """The fit with laws learnt from their start."""
    flights = FlightFit(likelihood, laws)
    alike = {name: theta for name, theta in fit.theta.items() if name not in laws}
    expected = _expected(likelihood, fit.shift, likelihood.shift(alike))
    cleaned = likelihood
    for _ in range(ROUNDS if alike else 1):
        flights.learn(expected[likelihood.real])
        cleaned = _cleaned(likelihood, flights)
        alike = ascend(cleaned, alike)
        shift = cleaned.shift(alike)
        expected = _expected(cleaned, shift, shift)
    theta = {name: flights.laws[name] if name in flights.laws else alike[name] for name in fit.theta}
    signatures = signature_columns(likelihood, theta)
    held = _held_entries(likelihood, flights)[likelihood.real][:, :, None]
    own = {name: likelihood.jacobian(name, value)[likelihood.real] for name, value in theta.items()}
    moved = [torch.where(held & (name in alike), 0.0, columns) for name, columns in own.items()]
    design = cleaned.joined([own[name] for name in alike] + [own[next(iter(own))][:, :, :0]], signatures)
    return Fit(
        fit.effects,
        theta,
        likelihood.shift(alike) + flights.shift(),
        likelihood.joined(moved, signatures),
        _log_score(likelihood, cleaned, flights, likelihood.shift(alike), design),
        flights.shares(),
    )


def _expected(likelihood: EffectsLikelihood, shift: Tensor, kept: Tensor) -> Tensor:
    """What is expected (n, p) of every flight with a part of a shift, where the whole of it is in the flights."""
    none = likelihood.with_common(torch.zeros(*shift.shape, 0, dtype=shift.dtype))
    mean, step = likelihood.moments(likelihood.weighted_rest(shift), none).solved()
    expected = likelihood.common.columns @ step + kept
    expected[:, likelihood.compared.free] += mean
    return expected


def _held_entries(likelihood: EffectsLikelihood, flights: FlightFit) -> Tensor:
    """Entries (n, p) that a path or rate decides and no effect that all flights have alike."""
    held = torch.zeros(len(likelihood.y), dtype=torch.bool)
    held[flights.at] = flights.holds_rate()
    return held[:, None] & likelihood.compared.of("rate")


def _cleaned(likelihood: EffectsLikelihood, flights: FlightFit) -> EffectsLikelihood:
    """The likelihood of the flights without what is expected of the laws, and without rates that are held."""
    held, whitening = _held_entries(likelihood, flights), likelihood.whitening
    y = torch.where(held, torch.nan, likelihood.compared.y - flights.shift())
    if bool(held.any()):
        whitening = whitening.only(torch.arange(y.shape[1]), y.isfinite())
    compared = replace(likelihood.compared, y=y)
    part = EffectsLikelihood(compared, whitening, likelihood.catalogue, 0, like=likelihood)
    part.fold = likelihood.fold
    return part


def _log_score(
    likelihood: EffectsLikelihood, cleaned: EffectsLikelihood, flights: FlightFit, shift: Tensor, design: Design
) -> Tensor:
    """Log score (n,) of each flight's mixture under mean, coefficients and laws of the other folds."""
    expected = cleaned.y - cleaned.held_out_errors(shift, design)
    error = likelihood.y - expected
    score = -0.5 * (error * likelihood.whitening.apply(error)).sum(1)
    for k in range(FOLDS):
        mine = likelihood.fold[flights.at] == k
        at = flights.at[mine]
        if len(at):
            score[at] += flights.log_ratio(
                flights.learnt(~mine),
                error[at],
                expected[at],
                torch.nonzero(mine)[:, 0],
                likelihood.whitening.rows(at),
            )
    return score
