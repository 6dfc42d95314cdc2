"""Weights, screening, inclusion and what is left, each on toys with known answers."""

import dataclasses
import math
from dataclasses import replace

import pytest
import torch
from scipy.special import expit
from scipy.stats import beta

from descentflow.diagnosis.inference import likelihood, screened_scores, set_search, subset_screening
from descentflow.diagnosis.inference.aircraft_groups import FOLDS
from descentflow.diagnosis.inference.discrepancy import discrepancy_columns, learnt_precision
from descentflow.diagnosis.inference.example_sides import example_likelihood, example_sides
from descentflow.diagnosis.inference.inclusion import WeightedSet, inclusion
from descentflow.diagnosis.inference.left_over import LeftOver, Part, left_over
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.model_weights import weights_of
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.selection import select
from descentflow.diagnosis.inference.set_search import SetSearch
from descentflow.diagnosis.inference.single_effects import every_single
from descentflow.diagnosis.inference.subset_screening import Screening, member_of, sets_of
from descentflow.diagnosis.inference.whitening import whiten
from descentflow.effects import EFFECTS

NAMES = ("temperature", "mass", "wind_gradient", "airspeed_bias")


def test_two_models_on_two_aircraft_have_the_weights_of_the_integral() -> None:
    """With two aircraft the first gap is uniform, so the weight is an integral over [0, 1] of a logistic function."""
    scores = torch.tensor([[1.0, -2.0], [-1.0, 2.5]], dtype=torch.float64)
    # One aircraft in a hundred is odd, and then as likely under either.
    density = 0.99 * scores.exp() + 0.01 * scores.exp().max(0).values
    lead = (density[0] / density[1]).log()
    share = torch.linspace(0.0, 1.0, 20001, dtype=torch.float64)
    z = 2 * (share * lead[0] + (1 - share) * lead[1]) - 0.7
    expected = float(torch.trapezoid(torch.from_numpy(expit(z.numpy())), share))
    found = weights_of(scores, torch.tensor([-0.7, 0.0], dtype=torch.float64))
    # Monte Carlo of 2,000 draws: a standard error of at most 1.1 %, exceeded four times once in 15,000.
    assert float(found[0]) == pytest.approx(expected, abs=0.045)
    assert float(found.sum()) == pytest.approx(1.0)


def test_a_lead_that_one_aircraft_makes_is_no_lead() -> None:
    """One of ten aircraft is for a model by 30 nats, nine against it by 1: an odd one decides for 4.6 of them."""
    scores = torch.zeros(2, 10, dtype=torch.float64)
    scores[0], scores[0, 0] = -1.0, 30.0
    lead, lag = -math.log(0.01), -math.log(0.99 * math.exp(-1.0) + 0.01)
    # The model leads where the one weighs more than so much; that is Beta(1, 9), and the step is sharp.
    expected = float(beta(1, 9).sf(lag / (lead + lag)))
    assert expected < 0.2
    assert float(weights_of(scores, torch.zeros(2, dtype=torch.float64))[0]) == pytest.approx(expected, abs=0.06)
    # Of any number of nats.
    scores[0, 0] = 3000.0
    assert float(weights_of(scores, torch.zeros(2, dtype=torch.float64))[0]) == pytest.approx(expected, abs=0.06)


def test_the_screening_is_as_good_as_fits_about_the_same_place() -> None:
    """Every set of four effects: the table of products gives the score that the likelihood gives flight by flight."""
    likelihood = example_likelihood(EFFECTS["temperature"], [6.0])
    theta = {name: fit_effects(likelihood, [name]).theta[name] for name in NAMES}
    members = [member_of(likelihood, name, theta[name]) for name in NAMES]
    columns = discrepancy_columns(likelihood.compared)
    precision = torch.full((len(columns),), 4.0, dtype=torch.float64)
    plain = Screening(likelihood, members).scores(sets_of(members))
    beside = Screening(likelihood, members, columns, precision).scores(sets_of(members))
    assert len(plain) == 16
    for names, score in plain.items():
        chosen = [m for m in members if m.name in names]
        offset = torch.zeros_like(likelihood.y)
        offset[likelihood.real] = sum((m.offset for m in chosen), torch.zeros_like(members[0].offset))
        own = [m.sensitivity for m in chosen]
        alike = torch.cat([torch.zeros(likelihood.y.shape[1], 0).double(), *(m.alike for m in chosen)], 1)
        design = likelihood.joined(own, alike)
        # Scaled equations have a ridge of 1e-6, and what is scaled differs in the last digits.
        expected = float(likelihood.log_score(offset, design).sum()) - likelihood.improbability(offset, design)
        assert score == pytest.approx(expected, abs=1e-2)
        wider = likelihood.joined([*own, columns.columns()[likelihood.real]], alike)
        prior = torch.cat([torch.zeros(design.n_parameters).double(), precision, torch.ones(alike.shape[1]).double()])
        wider = replace(wider, own_ridge=prior)
        expected = float(likelihood.log_score(offset, wider).sum())
        # The discrepancy is at its best in the table, and its own prior is no part of it.
        assert expected - 60.0 < beside[names] < expected + 1e-2


def test_held_out_scores_are_those_of_fits_without_the_fold() -> None:
    """One fold, with its sums written out flight by flight: mean, habits, sensitivities and their priors."""
    likelihood = example_likelihood(EFFECTS["mass"], [0.1])
    theta = {"mass": torch.tensor([0.1], dtype=torch.float64)}
    shift, design = likelihood.shift(theta), likelihood.design(theta)
    free = likelihood.compared.free
    p = likelihood.y.shape[1]
    unit = torch.eye(p, dtype=torch.float64)[:, free].expand(len(likelihood.y), -1, -1)
    every = torch.cat([unit, design.columns], 2)
    ridge = torch.cat([torch.zeros(int(free.sum()), dtype=torch.float64), design.ridge])
    precision = likelihood.whitening.precision[likelihood.whitening.pattern]
    train, out = likelihood.fold != 2, likelihood.fold == 2
    weighted = every.transpose(1, 2) @ precision
    matrix = (weighted @ every)[train].sum(0) + torch.diag(ridge)
    target = (weighted @ (likelihood.y - shift)[:, :, None])[train].sum(0)[:, 0]
    left = (likelihood.y - shift) - (every @ torch.linalg.lstsq(matrix, target[:, None]).solution)[:, :, 0]
    expected = -0.5 * torch.einsum("np,npq,nq->n", left, precision, left)
    found = likelihood.log_score(shift, design)
    assert FOLDS == 5
    torch.testing.assert_close(found[out], expected[out], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("exact", [False, True])
def test_the_misfit_of_a_large_effect_names_no_second(monkeypatch: pytest.MonkeyPatch, exact: bool) -> None:
    """Air 25 K warmer, whose equations are off by over half of the rate's shift: a second if taken as exact."""
    sides = example_sides(EFFECTS["temperature"], [25.0], n=200)
    at = sides.columns("rate")
    shift = sides.vector(EFFECTS["temperature"].shift(sides.state, torch.tensor([25.0], dtype=torch.float64)))
    noise = sides.y - torch.where(sides.real[:, None], shift, 0.0)
    # A spread between flights of 1.5 % shows what one of 5 % would hide.
    sides.y[:, at] = torch.where(sides.real[:, None], 1.6 * shift, 0.0)[:, at] + 0.3 * noise[:, at]
    if exact:
        for module in (likelihood, subset_screening):
            monkeypatch.setattr(module, "signature_columns", lambda shifts, theta: torch.zeros(33, 0).double())
    weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight())
    catalogue = {name: EFFECTS[name] for name in ("temperature", "mass", "drag_polar")}
    held = EffectsLikelihood(sides, weights, catalogue, seed=0)
    chosen = select(held, discrepancy_columns(sides), lambda _: None)
    assert "temperature" in chosen.fit.effects
    assert (len(chosen.fit.effects) > 1) == exact


def test_rivals_share_the_probability_and_are_one_group() -> None:
    sets = [
        WeightedSet(("temperature", "mass"), False, 0.25),
        WeightedSet(("temperature", "drag_polar"), False, 0.2),
        WeightedSet(("temperature",), True, 0.51),
        WeightedSet(("temperature", "mass", "level_off"), False, 0.04),
    ]
    found = inclusion(sets)
    assert found.best == ("temperature",)
    assert found.probability["mass"] == pytest.approx(0.29)
    assert found.discrepancy == pytest.approx(0.51)
    weights = (0.3, 0.3, 0.04, 0.36)
    found = inclusion([dataclasses.replace(one, weight=w) for one, w in zip(sets, weights, strict=True)])
    assert found.best == ("temperature", "mass", "level_off")
    assert found.groups == {"temperature": (), "mass": ("drag_polar",), "level_off": ()}
    assert found.of_group["mass"] == pytest.approx(0.96)
    assert found.named == ("temperature", "mass")


def test_an_effect_that_only_a_discrepancy_makes_room_for_is_not_named() -> None:
    beside = [WeightedSet(("temperature", "mass"), True, 0.95), WeightedSet(("temperature",), False, 0.05)]
    alone = [WeightedSet(("temperature", "mass"), False, 0.02), WeightedSet(("temperature",), False, 0.98)]
    assert inclusion(beside).named == ("temperature", "mass")
    found = inclusion(beside, alone)
    assert found.named == ("temperature",)
    assert found.of_group["mass"] == pytest.approx(0.02)


def test_the_spread_of_a_discrepancy_is_learnt_where_there_is_one() -> None:
    """Coefficients of spread 0.3 in one quantity and none in the other, each seen with an error of 0.05."""
    generator = torch.Generator().manual_seed(0)
    of = torch.tensor([0] * 12 + [1] * 12)
    truth = torch.where(of == 0, 0.3 * torch.randn(24, generator=generator, dtype=torch.float64), 0.0)
    seen = truth + 0.05 * torch.randn(24, generator=generator, dtype=torch.float64)
    precision, cost = learnt_precision(400.0 * torch.eye(24, dtype=torch.float64), 400.0 * seen, of)
    spread = precision.rsqrt()
    assert float(spread[0]) == pytest.approx(0.3)
    assert float(spread[-1]) == pytest.approx(0.03)
    # ln(1 + spread^2 information) of each, halved.
    assert cost == pytest.approx(6 * math.log(1 + 0.09 * 400) + 6 * math.log(1 + 0.0009 * 400))


@pytest.mark.parametrize(("slower", "left"), [(0.0, False), (-0.02, False), (-0.18, True)])
def test_what_is_left_is_judged_in_the_rate_and_not_in_nats(slower: float, left: bool) -> None:
    """Ten kelvin shift the TAS by many spreads; flights that descend 18 % slower besides are half of what matters."""
    sides = example_sides(EFFECTS["temperature"], [10.0], n=150)
    at = sides.columns("rate")
    sides.y[:, at] += torch.where(sides.real[:, None], slower, 0.0)
    weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight())
    likelihood = EffectsLikelihood(sides, weights, {"temperature": EFFECTS["temperature"]}, seed=0)
    columns = discrepancy_columns(sides)
    chosen = select(likelihood, columns, lambda _: None)
    assert chosen.fit.effects == ("temperature",)
    found = left_over(likelihood, chosen.fit, torch.zeros(sides.y.shape[1], dtype=torch.float64), 0.02)
    assert found.is_gap == left
    if left:
        assert chosen.outside.named
        # The air is as warm as its TAS says, so it is a part of the answer.
        assert chosen.beside is not None
        beside = left_over(likelihood, chosen.beside, torch.zeros(sides.y.shape[1], dtype=torch.float64), 0.02)
        assert beside.confirmed == ("temperature",)
        rate = [part for part in found.parts if part.quantity == "rate"]
        # Within the error of a mean over 150 flights of 5 % that are alike in all bands, three times over.
        assert rate[0].left == pytest.approx(slower, abs=3 * 0.05 * (2 / 150) ** 0.5)


def test_an_effect_that_leaves_the_quantity_that_it_moves_is_not_confirmed() -> None:
    """Flights that are slow aloft and not below: drag that explains half of it in the mean leaves both ends."""
    sides = example_sides(EFFECTS["drag_polar"], [0.0], n=150)
    at = sides.columns("rate")
    slope = torch.linspace(0.0, -0.3, len(at), dtype=torch.float64)
    sides.y[:, at] += torch.where(sides.real[:, None], slope, 0.0)
    weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight())
    likelihood = EffectsLikelihood(sides, weights, {"drag_polar": EFFECTS["drag_polar"]}, seed=0)
    fit = fit_effects(likelihood, ["drag_polar"])
    found = left_over(likelihood, fit, torch.zeros(sides.y.shape[1], dtype=torch.float64), 0.02)
    assert found.is_gap
    assert found.confirmed == ()


@pytest.mark.parametrize(("error", "called"), [(0.01, 0.02), (0.0, 1.0)])
def test_chance_leaves_a_gap_as_rarely_as_one_is_called(error: float, called: float) -> None:
    """Means of ten parts that are chance: of 2,000 sets 2 % have one left; all have if the error is taken for none."""
    left = 0.01 * torch.randn(2000, 10, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    found = [
        LeftOver(tuple(Part("rate", 150.0, 290.0, 0.0, x, error, 0.0, 0.0) for x in row), 0.02).is_gap
        for row in left.tolist()
    ]
    # Four standard errors of a share of 2 %: exceeded once in 15,000.
    assert sum(found) / len(found) == pytest.approx(called, abs=4 * (0.02 * 0.98 / 2000) ** 0.5)


def test_nothing_is_named_where_nothing_differs() -> None:
    likelihood = example_likelihood()
    chosen = select(likelihood, discrepancy_columns(likelihood.compared), lambda _: None)
    assert chosen.fit.effects == ()
    assert not chosen.outside.named


def test_a_set_grows_beyond_what_was_screened(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sets of one effect are screened, two are planted: the second is found beside the first, and no third."""
    monkeypatch.setattr(screened_scores, "MAX_EFFECTS", 1)
    sides = example_sides(EFFECTS["temperature"], [10.0])
    more = sides.vector(EFFECTS["airspeed_bias"].shift(sides.state, torch.tensor([6.0, 0.0]).double()))
    sides = replace(sides, y=sides.y + torch.where(sides.real[:, None], more, 0.0))
    weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight())
    likelihood = EffectsLikelihood(sides, weights, {name: EFFECTS[name] for name in NAMES}, seed=0)
    null = fit_effects(likelihood, ())
    singles = every_single(likelihood, null, lambda stage: None)
    columns = discrepancy_columns(sides)
    sets, _ = SetSearch(likelihood, columns, null, singles, lambda stage: None).weighted()
    assert set(max(sets, key=lambda one: one.weight).effects) == {"temperature", "airspeed_bias"}


def test_a_part_that_is_fitted_late_is_weighed_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """A set with an effect that is not credible stands for the rest of it, which is fitted when sets are weighed."""
    likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
    null = fit_effects(likelihood, ())
    singles = every_single(likelihood, null, lambda stage: None)
    columns = discrepancy_columns(likelihood.compared)
    search = SetSearch(likelihood, columns, null, singles, lambda stage: None)
    del search.fits[frozenset(["temperature"])]
    both = ("temperature", "airspeed_bias")
    search.fits[frozenset(both)] = fit_effects(likelihood, both, search.start)
    monkeypatch.setattr(set_search, "is_credible", lambda likelihood, fit, name: name != "airspeed_bias")
    sets, _ = search._weighed()
    assert ("temperature",) in {one.effects for one in sets}
    assert not any("airspeed_bias" in one.effects for one in sets)
