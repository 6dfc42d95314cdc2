"""The test whether there is a gap: its p-value is uniform where there is none, for fleets of all kinds."""

from collections.abc import Sequence
from dataclasses import replace

import pytest
import torch
from gaussian_toys import FlightLaw
from scipy.stats import binom, kstest
from torch import Tensor

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.diagnosis.inference.blind_whitening import blind_whitening
from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
from descentflow.diagnosis.inference.example_sides import example_likelihood
from descentflow.diagnosis.inference.label_scores import LabelScores
from descentflow.diagnosis.inference.labellings import labellings_of
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.permutation import null_test
from descentflow.diagnosis.inference.two_sides import Compared, compare
from descentflow.effects import EFFECTS
from descentflow.measurements.quantities import Quantities

TRANSITION_FL = 318.0
QUANTITIES = ("rate", "cas", "tas", "noise_rate", "level")
"""Enough to have every kind of effect, window and cell, and half as many entries."""


Known = dict[tuple[str, tuple[float, ...]], Tensor]
"""Sensitivities by effect and parameters."""


class Reused(EffectsLikelihood):
    """Sensitivities are those of the first flights drawn: speeds are the same in all draws."""

    def __init__(self, compared: Compared, known: Known) -> None:
        self.known = known
        super().__init__(compared, blind_whitening(compared, 0), EFFECTS, seed=0)

    def jacobian(self, name: str, theta: Tensor) -> Tensor:
        key = (name, tuple(theta.tolist()))
        if key not in self.known:
            self.known[key] = super().jacobian(name, theta)
        return self.known[key]


@pytest.fixture(scope="module")
def law(halves: tuple[Quantities, Quantities]) -> FlightLaw:
    whole = compare(*halves, open_aircraft("A320"))
    some = torch.stack([whole.of(quantity) for quantity in QUANTITIES]).any(0)
    return FlightLaw.of(whole.only(torch.nonzero(some)[:, 0]))


def p_values(law: FlightLaw, simulated: Sequence[int], real: Sequence[int], seeds: range, count: int) -> list[float]:
    known: Known = {}
    columns = discrepancy_columns(law.draw(simulated, real, 0, speeds=0))
    found = []
    for seed in seeds:
        null = Reused(law.draw(simulated, real, seed, speeds=0), known)
        found.append(null_test(null, columns, TRANSITION_FL, seed, count).p_value)
    return found


FLEETS = {
    "one flight an aircraft against five": ([1] * 150, [5] * 40),
    "five against five": ([5] * 40, [5] * 40),
    "twenty against five": ([20] * 20, [5] * 40),
}


@pytest.mark.slow
@pytest.mark.parametrize("fleet", FLEETS)
def test_p_values_are_uniform_whatever_the_fleets(law: FlightLaw, fleet: str) -> None:
    """200 nulls; a right test fails in one of 500 choices of seeds, 1 in 1,000 for each of both statistics."""
    found = p_values(law, *FLEETS[fleet], seeds=range(200), count=399)
    # The p-values are multiples of 1/400, which moves the largest distance of 200 by 1/400 at most.
    assert kstest(found, "uniform").pvalue > 0.001
    assert sum(p <= 0.02 for p in found) <= binom.isf(0.001, 200, 0.02)


def test_p_values_of_a_few_nulls_are_uniform(law: FlightLaw) -> None:
    """Unequal fleets; a right test fails in one of 100 choices of seeds, and these are fixed."""
    found = p_values(law, [1] * 60, [5] * 20, seeds=range(20), count=99)
    assert kstest(found, "uniform").pvalue > 0.01


def test_nothing_knows_which_labelling_is_the_true_one(law: FlightLaw) -> None:
    """Scores of the same labellings are the same ones, whichever is taken for the sides."""
    null = law.draw([2] * 30, [2] * 30, seed=7)
    labels = labellings_of(null, 9, seed=0)
    other = replace(null, real=labels.flights(4))
    columns = discrepancy_columns(null).columns()
    first, second = (
        LabelScores.of(Reused(sides, {}), labels).normal_score(columns, ridge=1.0) for sides in (null, other)
    )
    torch.testing.assert_close(first, second, rtol=1e-9, atol=1e-9)


def test_scores_are_those_of_each_labelling_by_itself(law: FlightLaw) -> None:
    """Against the formula written out for one column, one labelling and one aircraft at a time."""
    sides = law.draw([1, 3, 2, 4, 1, 2], [2, 2, 5, 1, 1, 3], seed=3)
    held, labels = Reused(sides, {}), labellings_of(sides, 3, seed=1)
    scores = LabelScores.of(held, labels)
    column = held.jacobian("temperature", torch.zeros(1, dtype=torch.float64))
    precision = [held.whitening.precision[k] for k in held.whitening.pattern]
    fixed = torch.cat([torch.eye(sides.y.shape[1]).double().expand(len(sides.y), -1, -1), held.common.columns], 2)
    prior = torch.cat([torch.zeros(sides.y.shape[1], dtype=torch.float64), held.common.ridge])
    whole = sum((f.T @ q @ f for f, q in zip(fixed, precision, strict=True)), torch.diag(prior))
    fitted = torch.linalg.solve(whole, sum(f.T @ q @ y for f, q, y in zip(fixed, precision, held.y, strict=True)))
    cross = torch.linalg.solve(whole, sum(f.T @ q @ x for f, q, x in zip(fixed, precision, column, strict=True)))
    expected = []
    for real in labels:
        part, aircraft = float(real.double().mean()), torch.zeros(int(sides.airframe.max()) + 1, dtype=torch.float64)
        for i, q in enumerate(precision):
            rest = q @ (held.y[i] - fixed[i] @ fitted)
            own = float(real[i]) * column[i, :, 0] @ rest - part * cross[:, 0] @ fixed[i].T @ rest
            aircraft[sides.airframe[i]] += own
        expected.append(aircraft.sum() / aircraft.square().sum().sqrt())
    torch.testing.assert_close(
        scores.one_sided(column, torch.ones(1, 1).double()), torch.stack(expected), rtol=1e-5, atol=1e-6
    )
    # With one degree of freedom, the square of the same.
    ratio = torch.stack(expected).square()
    normal = (ratio ** (1 / 3) - (1 - 2 / 9)) / (2 / 9) ** 0.5
    torch.testing.assert_close(scores.normal_score(column), normal, rtol=1e-4, atol=1e-5)


def test_scores_of_permuted_flights_are_near_normal(law: FlightLaw) -> None:
    """So that effects of one parameter and a discrepancy of twenty can be set beside each other."""
    null = law.draw([2] * 60, [2] * 60, seed=11)
    held = Reused(null, {})
    scores = LabelScores.of(held, labellings_of(null, 2000, seed=0))
    discrepancy, mass = discrepancy_columns(null).columns(), held.jacobian("mass", torch.zeros(1).double())
    for columns, ridge in ((discrepancy, 1.0), (mass, 0.0)):
        found = scores.normal_score(columns, ridge)
        # Means of 2,000 are known to 0.02; the rest is what is left of the skewness, and of the variances' own error.
        assert float(found.mean()) == pytest.approx(0.0, abs=0.15)
        assert float(found.std()) == pytest.approx(1.0, abs=0.15)


def test_levels_narrower_than_any_window_are_tested_without_windows() -> None:
    """Flights between FL320 and FL374 ended in a traceback, for no brakes fit between their levels."""
    likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
    columns = discrepancy_columns(likelihood.compared)
    whole = null_test(likelihood, columns, TRANSITION_FL, seed=0, count=19)
    assert whole.by_window > 0
    for name in list(likelihood.catalogue):
        if (effect := likelihood.windowed(name)) is not None:
            narrow = type("Narrow", (type(effect),), {"narrowest_fl": 1000.0})()
            likelihood.catalogue = {**likelihood.catalogue, name: narrow}
    found = null_test(likelihood, columns, TRANSITION_FL, seed=0, count=19)
    assert found.by_window == 0
    assert found.p_value == pytest.approx(0.05)
    assert found.by_effect == pytest.approx(whole.by_effect)


@pytest.mark.parametrize(("aircraft", "compared"), [(1, False), (6, False), (7, True)])
def test_what_a_few_aircraft_show_alone_is_not_compared(
    halves: tuple[Quantities, Quantities], aircraft: int, compared: bool
) -> None:
    """With one flight that flies level, what tells labellings apart is how many flights the sides have."""
    simulated, real = halves
    names = torch.unique(simulated.airframe)[:aircraft]
    level = {"level": 20.0 * torch.isin(simulated.airframe, names).to(simulated.values["level"])}
    simulated = replace(simulated, values={**simulated.values, **level})
    real = replace(real, values={**real.values, "level": torch.zeros_like(real.values["level"])})
    assert ("level" in compare(simulated, real, open_aircraft("A320")).quantities()) == compared
