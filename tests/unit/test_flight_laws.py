"""Effects that flights have each in their own way: closed forms against brute force, and laws that are recovered."""

import dataclasses

import flight_toys
import numpy as np
import pytest
import torch
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from descentflow.diagnosis.inference import flight_fit, mixed_fit
from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
from descentflow.diagnosis.inference.example_sides import example_likelihood
from descentflow.diagnosis.inference.flight_fit import FlightFit
from descentflow.diagnosis.inference.flight_laws import NEGLIGIBLE, Law, log_ratio, taken
from descentflow.diagnosis.inference.flight_ways import WaysOfFlights
from descentflow.diagnosis.inference.likelihood import FlightShares
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.selection import select
from descentflow.diagnosis.inference.set_search import SetSearch
from descentflow.diagnosis.inference.size_in_ways import Explained
from descentflow.diagnosis.inference.two_sides import Entry
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.effects import EFFECTS
from descentflow.effects.example_flights import example_flights
from descentflow.effects.flight_law import Ways
from descentflow.effects.speed_brake import SpeedBrake

MEAN, SPREAD = 0.4, 0.25
"""Law of sizes."""


def small() -> tuple[Ways, list[Entry], Whitening, torch.Tensor, torch.Tensor]:
    """Three flights of four entries, two patterns of what is seen, and five ways over three slots."""
    generator = torch.Generator().manual_seed(5)
    entries = [Entry("cas", 0), Entry("rate", 0), Entry("rate", 1), Entry("rate", 2)]
    slots = (("rate", 0), ("rate", 1), ("rate", 2), ("rate", 7))
    ways = Ways(
        slots,
        torch.rand(3, 4, generator=generator).double() + 0.5,
        0.3 * torch.randn(3, 4, generator=generator).double(),
        torch.tensor([[0, 0, 0, 0], [0.5, 0, 0, 0], [1, 0.4, 0, 0], [1, 1, 1, 1]]).double(),
        torch.tensor([0, 0, 1, 1, 2]),
        torch.tensor([2, 3, 2, 3, 3]),
    )
    root = torch.randn(4, 4, generator=generator).double()
    covariance = 0.05 * (root @ root.T + torch.eye(4))
    seen = torch.tensor([[True, True, True, True], [True, True, False, True], [True, True, True, True]])
    whitening = Whitening(torch.zeros(3, dtype=torch.long), covariance[None], covariance, torch.ones(3), covariance)
    rest = torch.where(seen, 0.4 * torch.randn(3, 4, generator=generator).double(), 0.0)
    return ways, entries, whitening.of_single_flights(torch.arange(3), seen), rest, seen


def density(i: int, way: int | None, size: float) -> float:
    """Density of what was seen of a flight that has the effect in a way, or has it not."""
    ways, _, whitening, rest, seen = small()
    shift = torch.zeros(4).double()
    if way is not None:
        weights = ways.table[ways.upper[way]] - ways.table[ways.lower[way]]
        shift[1:] = (ways.offset[i] + size * weights * ways.shape[i])[:3]
    there = seen[i]
    return float(
        multivariate_normal(shift[there].numpy(), whitening.covariance[there][:, there].numpy()).pdf(rest[i][there])
    )


@pytest.mark.parametrize("i", [0, 1, 2])
def test_each_way_is_as_likely_as_the_densities_say(i: int) -> None:
    ways, entries, whitening, rest, _ = small()
    likely = WaysOfFlights(ways, entries, whitening).explained(rest).under(MEAN, SPREAD)
    law, above = norm(MEAN, SPREAD), 1 - norm.cdf(-MEAN / SPREAD)
    for way in range(5):
        moments = [
            quad(lambda a, w=way, k=k: a**k * density(i, w, a) * law.pdf(a) / above, 0, 3, epsabs=1e-12)[0]
            for k in range(3)
        ]
        # Quadrature is good to some 1e-8; precisions are inverted with a ridge of 1e-8.
        assert float(likely.log_ratio[i, way]) == pytest.approx(np.log(moments[0] / density(i, None, 0.0)), abs=1e-5)
        mean = moments[1] / moments[0]
        assert float(likely.size[i, way]) == pytest.approx(mean, abs=1e-5)
        assert float(likely.variance[i, way]) == pytest.approx(moments[2] / moments[0] - mean**2, abs=1e-5)


@pytest.mark.parametrize("spread", [0.0, SPREAD])
def test_what_a_mixture_scores_is_the_same_without_what_each_flight_has(spread: float) -> None:
    ways, entries, whitening, rest, _ = small()
    # The second is far below zero: a law that is cut off there needs another formula.
    seen = {
        name: WaysOfFlights(ways, entries, whitening).explained(sign * rest) for name, sign in (("a", 1), ("b", -9))
    }
    prior = torch.full((5,), 0.2).double().log()
    laws = {"a": Law(prior, 0.3, MEAN, spread), "b": Law(prior, 0.5, 2 * MEAN, spread)}
    torch.testing.assert_close(log_ratio(seen, laws), taken(seen, laws).log_ratio)


def test_a_size_far_below_zero_is_no_evidence() -> None:
    one = torch.ones(1, 1).double()
    # A slope of -500 at a curvature of 100: the flight shows minus five, fifty standard deviations below zero.
    likely = Explained(-500 * one, 100 * one, torch.zeros(1).double()).under(MEAN, SPREAD)
    assert float(likely.log_ratio) < 0
    assert 0 < float(likely.size) < 0.01
    assert bool(likely.variance.isfinite().all())


def test_the_mixture_is_the_sum_over_all_ways() -> None:
    ways, entries, whitening, rest, _ = small()
    prior, share = torch.tensor([0.1, 0.2, 0.3, 0.25, 0.15]).double(), 0.3
    placed = WaysOfFlights(ways, entries, whitening)
    found = taken({"e": placed.explained(rest)}, {"e": Law(prior.log(), share, MEAN, 0.0)})
    probability = found.ways["e"].placed(found.ways["e"].probability)
    for i in range(3):
        none, each = density(i, None, 0.0), [density(i, way, MEAN) for way in range(5)]
        whole = (1 - share) * none + share * float(prior @ torch.tensor(each).double())
        assert float(found.log_ratio[i]) == pytest.approx(np.log(whole / none), abs=1e-6)
        exact = share * prior * torch.tensor(each).double() / whole
        torch.testing.assert_close(probability[i], exact, atol=1e-6, rtol=0)
    # The expected shift is the sum over the ways, each at its size.
    shift = placed.placed(placed.at_slots(found.ways["e"]))
    brute = torch.zeros(3, 4).double()
    for way in range(5):
        weights = (ways.table[ways.upper[way]] - ways.table[ways.lower[way]])[:3]
        shown = ways.offset[:, :3] + MEAN * weights * ways.shape[:, :3]
        brute[:, 1:] += probability[:, way, None] * shown
    torch.testing.assert_close(shift, brute)


@pytest.mark.parametrize("spread", [0.0, 0.05, SPREAD])
def test_ways_that_are_told_by_their_bound_change_no_number_that_is_reported(spread: float) -> None:
    generator = torch.Generator().manual_seed(11)
    # From flights that show nothing to some of which hundreds of nats tell one way from another.
    scale = torch.logspace(-1, 2.5, 60).double()[:, None]
    seen = {
        name: Explained(
            scale * 2 * torch.randn(60, 40, generator=generator).double(),
            scale * torch.rand(60, 40, generator=generator).double(),
            torch.randn(60, generator=generator).double(),
        )
        for name in ("a", "b")
    }
    prior = torch.full((40,), 1 / 40).double().log()
    laws = {"a": Law(prior, 0.3, MEAN, spread), "b": Law(prior, 0.6, 2 * MEAN, spread)}
    found = taken(seen, laws)
    likely = {name: seen[name].under(law.mean, law.spread) for name, law in laws.items()}
    joint = {name: likely[name].log_ratio + law.log_joint for name, law in laws.items()}
    none = torch.full((60, 1), np.log(0.1), dtype=torch.float64)
    whole = torch.cat([none, *joint.values()], 1).logsumexp(1)
    # Of 80 ways of a flight each that is left out has less than e^-25 of its probability.
    left_out = 80 * np.exp(-NEGLIGIBLE)
    torch.testing.assert_close(found.log_ratio, whole, atol=left_out, rtol=1e-12)
    assert len(found.ways["a"].way) < 2000  # of 2,400: some are left out
    for name, law in laws.items():
        assert bool((seen[name].bound(law.mean, law.spread) >= likely[name].log_ratio - 1e-9).all())
        probability, ways = (joint[name] - whole[:, None]).exp(), found.ways[name]
        torch.testing.assert_close(ways.placed(ways.probability), probability, atol=left_out, rtol=1e-8)
        sums = probability, probability * likely[name].size
        squared = probability * (likely[name].size.square() + likely[name].variance)
        for got, table in zip(dataclasses.astuple(ways.learnt())[:3], (*sums, squared), strict=True):
            # In sums over 60 flights.
            torch.testing.assert_close(got, table.sum(0), atol=60 * left_out, rtol=1e-8)


@pytest.fixture(scope="module")
def windows() -> tuple[object, torch.Tensor, torch.Tensor, object]:
    compared, chosen, low = flight_toys.with_own_windows(300, share=0.35, size=0.5)
    held = flight_toys.likelihood(compared)
    return held, chosen, low, fit_effects(held, ["speed_brake"])


def test_shares_sizes_and_levels_of_own_windows_are_recovered(windows) -> None:
    held, chosen, low, fit = windows
    law, own = fit.theta["speed_brake"], fit.per_flight["speed_brake"]
    found = own.share[held.real] > 0.5
    # Half as much drag again stands out of the toy's noise by far: no flight is taken wrongly but where levels hide it.
    assert int((found != chosen).sum()) <= 3
    assert float(law[3]) == pytest.approx(float(chosen.double().mean()), abs=0.015)
    assert float(law[0] / law[3]) == pytest.approx(0.5, abs=0.03)
    # The mean of the chosen flights' levels, known to 5 FL's rounding: an error of 1.4 FL a flight.
    right = found & chosen
    error = (own.numbers["low_fl"][held.real] - low)[right]
    assert float(error.mean()) == pytest.approx(0.0, abs=4 * 2.0 / float(right.sum()) ** 0.5)
    assert float(error.std()) < 4.0
    assert float(law[5]) == pytest.approx(float(low[chosen].std()), abs=3.0)


def test_own_windows_score_higher_than_one_for_all(windows) -> None:
    held, _, _, fit = windows
    null = fit_effects(held, ())
    mean_alone = held.log_score(held.shift(fit.theta), held.design(fit.theta))
    assert held.gain(fit.log_score, mean_alone)[0] > 10 * abs(held.gain(mean_alone, null.log_score)[0])


def test_laws_sought_with_fewer_windows_end_where_all_windows_lead(windows, monkeypatch) -> None:
    held, _, _, fit = windows
    start = fit.theta["speed_brake"] * torch.tensor([0.8, 1.0, 1.0, 0.8, 1.0, 1.2, 1.2, 1.2]).double()
    found, ways = [], []
    settle = FlightFit._settle

    def settled(self, *asked) -> None:
        settle(self, *asked)
        ways.append(self.taken.ways["speed_brake"].shape[1])

    monkeypatch.setattr(FlightFit, "_settle", settled)
    for coarse in (True, False):
        if not coarse:
            monkeypatch.setattr(SpeedBrake, "coarser", lambda self, theta: self)
        flights = FlightFit(held, {"speed_brake": start})
        flights.learn(torch.zeros_like(held.y[held.real]))
        found.append(flights.laws["speed_brake"])
    assert min(ways) < 0.35 * max(ways)
    assert ways[-1] == max(ways)
    # As where laws of some flights are gone on with: a fifth of a standard deviation of any parameter or so.
    assert float(found[1][0] / found[1][3]) == pytest.approx(float(found[0][0] / found[0][3]), rel=0.02)
    assert float(found[1][3]) == pytest.approx(float(found[0][3]), abs=0.01)
    torch.testing.assert_close(found[0][1:3], found[1][1:3], rtol=0, atol=2.0)


def test_laws_of_many_flights_are_begun_with_some_and_end_where_all_lead(windows, monkeypatch) -> None:
    held, _, _, fit = windows
    start = fit.theta["speed_brake"] * torch.tensor([0.8, 1.0, 1.0, 0.8, 1.0, 1.2, 1.2, 1.2]).double()
    found, steps = [], []
    settle = FlightFit._settle
    monkeypatch.setattr(FlightFit, "_settle", lambda self, *a: (steps.append(len(self.at)), settle(self, *a)))
    for many in (10**6, 150):
        monkeypatch.setattr(flight_fit, "MANY", many)
        steps.clear()
        flights = FlightFit(held, {"speed_brake": start})
        flights.learn(torch.zeros_like(held.y[held.real]))
        found.append(flights.laws["speed_brake"])
        assert min(steps) == (len(flights.at) if many > 150 else len(flights.at[:: 2 * len(flights.at) // 150]))
    size, share = found[0][0] / found[0][3], found[0][3]
    # What a step gains when the steps end, 0.2 nats, is a fifth of a standard deviation of any parameter or so.
    assert float(found[1][0] / found[1][3]) == pytest.approx(float(size), rel=0.02)
    assert float(found[1][3]) == pytest.approx(float(share), abs=0.01)


def test_the_log_score_is_that_of_the_mixture(windows) -> None:
    held, _, _, fit = windows
    law = {"speed_brake": fit.theta["speed_brake"]}
    flights = FlightFit(held, law)
    some = torch.arange(0, 300, 60)
    expected = torch.zeros(len(some), held.y.shape[1]).double()
    precision = held.whitening.rows(flights.at[some])
    rest = held.y[flights.at[some]]
    found = flights.log_ratio(law, rest, expected, flights.at[some])
    effect, theta = held.catalogue["speed_brake"], law["speed_brake"]
    ways = effect.ways(flights.state.rows(some), theta, expected[:, :11])
    share, mean, spread = effect.size(theta)
    prior = effect.log_prior(flights.state, theta).exp()
    at = held.compared.columns("rate")
    sizes = np.linspace(0, mean + 6 * spread, 200)
    weight = norm(mean, spread).pdf(sizes) / (1 - norm.cdf(-mean / spread)) * (sizes[1] - sizes[0])
    for k in range(len(some)):
        covariance = torch.linalg.inv(precision.precision[precision.pattern[k]]).numpy()
        base = multivariate_normal(np.zeros(len(rest[k])), covariance)
        shape = ways.table[ways.upper] - ways.table[ways.lower]
        total = 0.0
        for row, p in zip(shape * ways.shape[k], prior, strict=True):
            shift = np.zeros((len(sizes), len(rest[k])))
            shift[:, at] = sizes[:, None] * row[:11].numpy()
            total += float(p) * float(
                (np.exp(base.logpdf(rest[k].numpy() - shift) - base.logpdf(rest[k])) * weight).sum()
            )
        # A sum over two hundred sizes is good to a few thousandths.
        assert float(found[k]) == pytest.approx(np.log(1 - share + share * total), abs=0.01)


@pytest.mark.parametrize("drag", [0.0, 0.1])
def test_an_effect_beside_a_path_is_not_biased_by_it(drag: float) -> None:
    compared, chosen = flight_toys.on_own_paths(300, share=0.6, drag=drag)
    held = flight_toys.likelihood(compared)
    fit = fit_effects(held, ["geometric_path", "drag_polar"])
    law = fit.theta["geometric_path"]
    assert float(law[0]) == pytest.approx(float(chosen.double().mean()), abs=0.04)
    assert float(law[1]) == pytest.approx(0.1, abs=0.015)
    # 120 flights whose level spreads by 4 %, against 300 of the simulator: four standard errors of their difference.
    error = 4 * 0.04 * (1 / 120 + 1 / 300) ** 0.5 / 0.85
    assert float(fit.theta["drag_polar"][0]) == pytest.approx(drag, abs=error)


@pytest.mark.parametrize(("drag", "second"), [(0.0, False), (0.1, True)])
def test_what_acts_beside_a_path_is_named_and_nothing_else(drag: float, second: bool) -> None:
    """Sets with a path are screened on the flights without it: a mean shift leaves too much of it for others."""
    compared, _ = flight_toys.on_own_paths(300, share=0.6, drag=drag)
    chosen = select(flight_toys.likelihood(compared), discrepancy_columns(compared), lambda _: None)
    found = {frozenset({name, *chosen.groups[name]}) for name in chosen.fit.effects}
    assert sum("geometric_path" in group for group in found) == 1
    assert any("drag_polar" in group for group in found) == second
    assert len(found) == 1 + second


@pytest.mark.parametrize(("share", "by_flight"), [(0.5, True), (1.0, False)])
def test_a_mean_shift_of_some_flights_stands_in_no_laws_way(
    share: float, by_flight: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No cause is made of it; of 100 flights with brakes in half, it scored 62.2 nats and the law 61.4."""
    theta = torch.tensor([0.4 * share, 200, 240, share, 0, 0, 0, 0], dtype=torch.float64)
    held = example_likelihood(EFFECTS["speed_brake"], theta.tolist())
    plain = dataclasses.replace(fit_effects(held, ()), effects=("speed_brake",), theta={"speed_brake": theta})
    own = FlightShares(torch.ones(len(held.y)), {}, torch.zeros_like(held.y))
    law = dataclasses.replace(plain, log_score=plain.log_score - 0.01, per_flight={"speed_brake": own})
    monkeypatch.setattr(mixed_fit, "_rounds", lambda *_: iter([law]))
    assert (mixed_fit.with_flight_laws(held, plain) is law) is by_flight


def test_no_law_where_all_flights_are_alike() -> None:
    held = flight_toys.likelihood(flight_toys.steady_sides(200))
    null = fit_effects(held, ())
    for name in ("speed_brake", "geometric_path"):
        fit = fit_effects(held, [name])
        gain, _ = held.gain(fit.log_score, null.log_score)
        # Gains of laws that are not there are those of a few free parameters.
        assert gain < 8.0


def test_nothing_is_left_beside_own_windows(windows) -> None:
    held, _, _, fit = windows
    columns = discrepancy_columns(held.compared)
    null = fit_effects(held, ())
    search = SetSearch(held, columns, null, {}, lambda _: None)
    left, error = held.gain(search.discrepancy.beside(fit).log_score, fit.log_score)
    # What a shift of no cause would add is what its free coefficients gain by chance, not the flights' own windows.
    assert left < 3 * error + 5.0
    alone, _ = held.gain(search.discrepancy.beside(null).log_score, null.log_score)
    assert alone > 100.0


def test_a_fit_from_its_own_law_gains_nothing(windows) -> None:
    """Laws are learnt until they settle: what a second effect gains is not that the first was learnt on."""
    held, _, _, fit = windows
    again = fit_effects(held, ["speed_brake"], fit.theta)
    assert abs(held.gain(again.log_score, fit.log_score)[0]) < 0.5


def test_brakes_of_both_sides_are_no_difference() -> None:
    """The simulator's flights have the same brakes as often: what their law explains of the real ones they show too."""
    compared, _, _ = flight_toys.with_own_windows(300, share=0.35, size=0.5)
    simulated = compared.y.clone()
    simulated[~compared.real] = compared.y[compared.real]
    alone = flight_toys.likelihood(compared)
    held = flight_toys.likelihood(dataclasses.replace(compared, y=simulated))
    one_side, both = (
        likelihood.gain(fit_effects(likelihood, ["speed_brake"]).log_score, fit_effects(likelihood, ()).log_score)
        for likelihood in (alone, held)
    )
    assert one_side[0] > 10 * one_side[1]
    assert both[0] < both[1] + 5.0


def test_a_share_at_its_bound_is_no_procedure() -> None:
    state, brakes = example_flights(), EFFECTS["speed_brake"]
    theta = torch.tensor([0.05, 200.0, 240.0, 0.05, 0.0, 0.0, 0.0, 0.1], dtype=torch.float64)
    assert not brakes.plausible(state, theta)
    theta[3] = 0.06
    assert brakes.plausible(state, theta)
    # All flights may have them.
    theta[0], theta[3] = 0.3, 1.0
    assert brakes.plausible(state, theta)
