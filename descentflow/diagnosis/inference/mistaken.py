"""Whether what flights seem to have each in its own way is rather what another effect leaves behind in some."""

import math

import torch
from torch import Tensor

from descentflow.diagnosis.inference.flight_fit import FlightFit
from descentflow.diagnosis.inference.flight_laws import Law, log_ratio
from descentflow.diagnosis.inference.flight_ways import WaysOfFlights
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood, Fit
from descentflow.diagnosis.inference.mixed_fit import expected_with
from descentflow.effects.flight_law import LeavesBehind


def share_its_own(likelihood: EffectsLikelihood, fit: Fit, name: str) -> float:
    """Of the flights with an effect, the share in which it is likelier than what another effect leaves behind.

    A flight that is slower in a window than elsewhere, because it held a rate there, is by its own mean faster
    elsewhere: as with brakes out. Which of the two it is shows in each flight, by the shape of either; both are as
    likely beforehand. The other effect need not be in the fit, for a law that takes its place would hide it.

    Args:
        likelihood: Of the flights.
        fit: With what each flight has of the effect.
        name: Of the effect, one that flights have each in their own way.

    Example:
        >>> from dataclasses import replace
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.diagnosis.inference.search import fit_effects
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["speed_brake"], [0.8, 200, 240, 1, 0, 0, 0, 0])
        >>> flights = FlightFit(likelihood, {"speed_brake": torch.tensor([0.7, 200, 240, 0.9, 0, 0, 0, 0.1]).double()})
        >>> flights.learn(torch.zeros_like(likelihood.y[likelihood.real]))
        >>> fit = fit_effects(likelihood, [])
        >>> fit = replace(fit, theta=flights.laws, shift=flights.shift(), per_flight=flights.shares())
        >>> share_its_own(likelihood, fit, "speed_brake") > 0.9  # all real flights of the example have brakes out
        True
    """
    at = torch.nonzero(likelihood.real)[:, 0]
    own, theta = fit.per_flight[name], fit.theta[name]
    flights = FlightFit(likelihood, {name: theta})
    expected = expected_with(likelihood, fit.shift, fit.shift - own.shift)[at]
    rest = torch.where(flights.seen, likelihood.compared.y[at].nan_to_num(0.0) - expected, 0.0)
    effect, ways = flights.effects[name], flights.ways({name: theta}, expected, flights.state, flights.single)[name]
    _, mean, spread = effect.size(theta)
    mine = _log_ratio(ways, rest, Law(effect.log_prior(flights.state, theta), 1.0, mean, spread))
    share = own.share[at]
    for other in likelihood.catalogue.values():
        if not isinstance(other, LeavesBehind):
            continue
        left = other.left_behind(flights.state)
        n = len(left.ways.lower)
        alike = torch.full((n,), -math.log(n), dtype=torch.float64)
        its = WaysOfFlights(left.ways, likelihood.compared.entries, flights.single)
        share = share * torch.sigmoid(mine - _log_ratio(its, rest, Law(alike, 1.0, left.mean, left.spread)))
    return float(share.sum() / own.share[at].sum().clamp(min=1e-9))


def _log_ratio(ways: WaysOfFlights, rest: Tensor, law: Law) -> Tensor:
    """Logarithm (r,) of how much likelier what is left of flights (r, p) is if all have an effect than if none has."""
    return log_ratio({"it": ways.explained(rest)}, {"it": law})
