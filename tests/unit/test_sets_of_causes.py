"""Sets of causes on toy differences: their weights, sizes and names against closed forms."""

import numpy as np
import pytest
import torch
from scipy import stats

from descentflow.core.linear_gaussian import Precisions, posterior, shrunk
from descentflow.diagnosis.inference.candidates import FlightsEffect
from descentflow.diagnosis.inference.explain import changed_surely, sizes_measured
from descentflow.diagnosis.inference.flight_mixture import LearntLaw
from descentflow.diagnosis.inference.moments import Moments
from descentflow.diagnosis.inference.naming import Named, name_effects
from descentflow.diagnosis.inference.sets import Search, SetFit, SetFits
from descentflow.diagnosis.inference.signatures import linearised
from descentflow.diagnosis.sides.assumptions import Assumptions
from descentflow.effects import EFFECTS

NONE = np.zeros(0)
LAW = LearntLaw(EFFECTS["speed_brake"], None, torch.zeros(8), None)  # type: ignore[arg-type]


def toy(difference: np.ndarray, sd: float = 0.1) -> Moments:
    """A difference of rates with independent errors."""
    p = len(difference)
    altitude = np.arange(p) * 600.0
    kernel = np.exp(-0.5 * ((altitude[:, None] - altitude) / 1800.0) ** 2)
    names = np.array(["rate"] * p)
    return Moments(difference, sd**2 * np.eye(p), np.zeros((1, p)), np.full(p, 0.002), names, kernel)


def column(name: str, shape: np.ndarray, prior_sd: float = 1.0) -> FlightsEffect:
    """A cause of a fixed shape and no misfit, whose size is expected to be one."""
    p = len(shape)
    return FlightsEffect(name, LAW, shape[:, None], 0.0, np.zeros((p, p)), np.array([prior_sd]))


def test_evidence_and_posterior_are_those_of_a_joint_normal_law() -> None:
    rng = np.random.default_rng(0)
    p, k = 7, 3
    root, jacobian = rng.normal(size=(p, p)), rng.normal(size=(p, k))
    noise, mean, spread = root @ root.T + np.eye(p), rng.normal(size=k), rng.uniform(0.5, 2.0, k)
    x = rng.normal(size=p)
    fitted = posterior(x, noise, jacobian, mean, spread)
    marginal = noise + (jacobian * spread**2) @ jacobian.T
    assert fitted.log_evidence == pytest.approx(stats.multivariate_normal(jacobian @ mean, marginal).logpdf(x))
    gain = (jacobian * spread**2).T @ np.linalg.inv(marginal)
    np.testing.assert_allclose(fitted.mean, mean + gain @ (x - jacobian @ mean))
    np.testing.assert_allclose(fitted.covariance, np.diag(spread**2) - gain @ jacobian * spread**2, atol=1e-12)


def test_evidence_without_sizes_is_a_normal_density() -> None:
    fitted = posterior(np.array([1.0, 2.0]), 4.0 * np.eye(2), np.zeros((2, 0)), NONE, NONE)
    assert fitted.log_evidence == pytest.approx(stats.norm(0, 2).logpdf([1.0, 2.0]).sum())


def test_sizes_settle_where_the_misfit_grows_with_them() -> None:
    shape = np.ones(11)
    cause = FlightsEffect("e", LAW, shape[:, None], 0.0, 0.02 * np.ones((11, 11)), np.array([0.3]))
    fits = SetFits(toy(3.0 * shape), [cause], Assumptions())
    first = fits.fit(("e",), rounds=12)
    again = fits.fit(("e",), first=first.sizes)
    assert again.sizes["e"][0] == pytest.approx(first.sizes["e"][0], rel=0.01)


def test_sizes_that_are_put_into_flights_make_the_means_whatever_shapes_expect() -> None:
    """Only the sizes of a law are put into flights: what goes with the share alone has a factor of one."""
    sized, of_share = -0.1 * np.ones(11), -np.linspace(0.0, 0.3, 11)
    parts = np.stack([sized, of_share], 1)
    cause = FlightsEffect("e", LAW, parts, 0.0, 0.1 * np.eye(11), np.array([0.1, 0.2]))
    known = toy(2.5 * sized + of_share, sd=0.001)
    fit = SetFits(known, [cause], Assumptions()).fit(("e",), is_exact=True)
    assert fit.sizes["e"] == pytest.approx([2.5, 1.0], rel=0.001)  # drawn to one by (0.001 / 0.1)^2 / 11


def test_shrinking_keeps_variances_and_makes_few_rows_invertible() -> None:
    rows = np.random.default_rng(2).normal(size=(10, 40))
    covariance = shrunk(rows)
    np.testing.assert_allclose(covariance.diagonal(), (rows.T @ rows).diagonal())
    assert np.linalg.cond(covariance) < 1e4
    assert np.linalg.matrix_rank(rows.T @ rows) == 10


@pytest.mark.parametrize("sizes", [(1.0, 0.0), (1.0, 1.0), (0.0, 0.0)])
def test_sets_of_toy_causes_have_the_weights_of_their_closed_form(sizes: tuple[float, float]) -> None:
    level, slope = np.ones(11), np.linspace(-1, 1, 11)
    known = toy(sizes[0] * level + sizes[1] * slope)
    causes = [column("level", level), column("slope", slope)]
    fits = SetFits(known, causes, Assumptions())
    odds = np.log(1 / 14)
    for names in [(), ("level",), ("slope",), ("level", "slope")]:
        shapes = np.array([level if name == "level" else slope for name in names]).reshape(len(names), 11)
        law = stats.multivariate_normal(shapes.sum(0), known.covariance + shapes.T @ shapes)
        assert fits.fit(names).log_weight == pytest.approx(law.logpdf(known.difference) + odds * len(names))
    best = Search(known, causes, Assumptions()).sets()[0]
    assert set(best.names) == {name for name, size in zip(("level", "slope"), sizes, strict=True) if size}


def test_intervals_of_sizes_hold_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(3)
    shape, inside = np.linspace(0.5, 1.5, 11), 0
    for _ in range(400):
        size = rng.normal(1.0, 1.0)
        fits = SetFits(toy(size * shape + 0.1 * rng.normal(size=11)), [column("e", shape)], Assumptions())
        fit = fits.fit(("e",))
        if fit.sizes["e"][0] > 0:  # sizes are not below zero
            inside += abs(fit.sizes["e"][0] - size) < 1.645 * fit.errors["e"][0]
        else:
            inside += size < 1.645 * fit.errors["e"][0]
    # Of 400, 90 % are 360 with a standard deviation of 6: a right interval fails once in 3,000.
    assert 340 <= inside <= 380


def test_what_no_cause_explains_is_unknown() -> None:
    bump = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    search = Search(toy(0.2 * bump, 0.005), [column("level", np.ones(11))], Assumptions())
    named = name_effects(search.sets(), Assumptions())
    assert named.unknown > 0.99
    assert not named.groups


def test_causes_that_look_alike_are_one_group() -> None:
    shape = np.ones(11)
    causes = [column("first", shape), column("second", shape * 1.001)]
    named = name_effects(Search(toy(shape, 0.01), causes, Assumptions()).sets(), Assumptions())
    assert {name: set(group) for name, group in named.groups.items()} in ({"first": {"second"}}, {"second": {"first"}})


def test_members_of_a_scale_group_stand_together_unless_one_is_surely_the_cause() -> None:
    weights = {"mass": 0.0, "drag_polar": -4.0, "idle_thrust": -9.0}
    sets = [SetFit((name,), {}, {}, {}, weight, {}, np.eye(1)) for name, weight in weights.items()]
    alike = [EFFECTS["mass"].scale_group.members]  # type: ignore[union-attr]
    assert name_effects(sets, Assumptions(), alike).groups == {"mass": ("drag_polar",)}


def test_linearised_candidates_are_their_own_where_they_are_linear() -> None:
    effect = column("e", np.linspace(0, 1, 5))
    candidate = linearised(effect.at(np.array([2.0])), np.array([-1.5]))
    np.testing.assert_allclose(candidate.shift, effect.at(np.array([0.5])).shift)


def test_bands_that_all_go_together_do_not_average_out() -> None:
    """All flights of an aircraft are faster at all levels: a mean of six bands is known as one band is."""
    alike, of_cas, kernel = 16.0 * np.ones((6, 6)), np.array(["cas"] * 6), np.eye(6)
    covariance = 0.8 * alike + 0.2 * 16.0 * np.eye(6)  # its correlations are shrunk by a fifth
    known = Moments(np.full(6, 12.0), covariance, np.zeros((1, 6)), np.full(6, 0.5), of_cas, kernel, alike - covariance)
    faster = column("faster", np.ones(6), prior_sd=15.0)
    best = SetFits(known, [faster], Assumptions()).fit(("faster",))
    assert best.errors["faster"][0] < 3.6
    assert sizes_measured(faster, best, known) == (pytest.approx([12.0]), pytest.approx([4.0]))
    rates = column("rates", np.zeros(6))
    assert sizes_measured(rates, SetFits(known, [rates], Assumptions()).fit(("rates",)), known) is None


def test_precisions_of_partly_seen_flights_are_those_of_what_is_seen() -> None:
    rng = np.random.default_rng(4)
    root = rng.normal(size=(4, 4))
    covariance = root @ root.T + np.eye(4)
    seen = np.array([[True, True, False, True], [True] * 4])
    values = np.where(seen, rng.normal(size=(2, 4)), 0.0)
    log_density = Precisions(covariance, seen).log_density(values)
    for i in range(2):
        at = np.flatnonzero(seen[i])
        law = stats.multivariate_normal(np.zeros(len(at)), covariance[np.ix_(at, at)])
        assert log_density[i] - 0.5 * len(at) * np.log(2 * np.pi) == pytest.approx(law.logpdf(values[i, at]))


class OfNoSureChange(FlightsEffect):
    """A cause whose interval holds no change, whatever its size."""

    def differs(self, sizes: np.ndarray, errors: np.ndarray) -> bool:
        return False


@pytest.mark.parametrize(
    ("sure", "other", "groups"),
    [(True, 0.4, {"second": ("first",)}), (False, 0.4, {}), (True, 0.3, {})],
    ids=["another is sure", "none is sure", "there may be no cause"],
)
def test_another_of_a_group_leads_where_the_first_may_be_no_change(
    sure: bool, other: float, groups: dict[str, object]
) -> None:
    first, second = (column(name, np.ones(11)) for name in ("first", "second"))
    unsure = [OfNoSureChange(**vars(cause)) for cause in (first, second)]
    fits = SetFits(toy(np.ones(11), 0.01), [unsure[0], second if sure else unsure[1]], Assumptions())
    named = Named(np.ones(1), {"first": 0.6, "second": other}, 0.0, 0.0, {"first": ("second",)})
    best, renamed = changed_surely(fits.fit(("first",)), named, fits.fit, fits)
    assert best.names == tuple(groups)
    assert renamed.groups == groups
