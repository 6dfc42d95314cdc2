"""Whether there is a gap at all: one p-value for all that was looked for, by permuting whole aircraft."""

from collections.abc import Iterator

import torch
from torch import Tensor

from descentflow.diagnosis.findings.findings import NullTest
from descentflow.diagnosis.inference.cells import cell_scores, cells
from descentflow.diagnosis.inference.discrepancy import DiscrepancyColumns
from descentflow.diagnosis.inference.label_scores import LabelScores
from descentflow.diagnosis.inference.labellings import labellings_of
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.step_down import ROUNDING
from descentflow.diagnosis.inference.window_search import FIRST_SIZE, band_columns
from descentflow.effects.flight_state import FlightState
from descentflow.effects.windowed_effect import WindowedEffect

PERMUTATIONS = 1999
"""The p-value is at least one in 2,000, and one of 2 % is known to a third of a percent."""
WINDOW_STEP_FL = 10.0
"""Ends of windows are tried in steps of so much: some hundred windows, one of which overlaps most of any other."""


def null_test(
    likelihood: EffectsLikelihood,
    discrepancy: DiscrepancyColumns,
    transition_fl: float,
    seed: int,
    count: int = PERMUTATIONS,
) -> NullTest:
    """Hold what explains the sides best against what explains permuted ones best.

    Everything that the diagnosis looks at counts: sensitivities of effects, every window in which one may lie, a free
    discrepancy, and cells of quantity and altitude. The most outstanding of each kind is set beside that of the other
    kinds in null spreads, and the largest of all against the largest under each labelling. So the p-value is corrected
    for all that was looked for, and it is uniform where there is no gap: nothing knows which labelling is the true one.

    Args:
        likelihood: With a covariance that does not know the sides, or the test would favour the true ones.
        discrepancy: Columns of a shift of any shape, with unit prior spread.
        transition_fl: Flight level at which cells are cut.
        seed: Of the permutations.
        count: Number of permutations; the p-value is at least ``1 / (1 + count)``.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_likelihood
        >>> from descentflow.effects import EFFECTS
        >>> likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> columns = discrepancy_columns(likelihood.compared)
        >>> null_test(likelihood, columns, transition_fl=290.0, seed=0, count=19).p_value
        0.05
    """
    compared = likelihood.compared
    labels = labellings_of(compared, count, seed)
    scores = LabelScores.of(likelihood, labels)
    kinds = {
        "effect": _largest(scores.normal_score(columns) for columns in _sensitivities(likelihood)),
        "window": _largest(scores.one_sided(columns, weights) for columns, weights in _windows(likelihood)),
        "discrepancy": scores.normal_score(discrepancy.columns(), ridge=1.0),
        "cell": cell_scores(compared.y, labels, cells(compared, transition_fl)).amax(1),
    }
    standing = {kind: _standing(value) for kind, value in kinds.items() if value is not None}
    largest = torch.stack(list(standing.values())).amax(0)
    p_value = float((largest >= largest[0] - ROUNDING).double().mean())
    by = {kind: float(value[0]) for kind, value in standing.items()}
    return NullTest(p_value, by.get("effect", 0.0), by["discrepancy"], count, by.get("window", 0.0), by["cell"])


def _largest(values: Iterator[Tensor]) -> Tensor | None:
    found = list(values)
    return torch.stack(found).amax(0) if found else None


def _standing(values: Tensor) -> Tensor:
    """Deviation from the mean over all labellings in their spreads; the true labelling is one like any other."""
    return (values - values.mean()) / values.std().clamp(min=1e-12)


def _sensitivities(likelihood: EffectsLikelihood) -> Iterator[Tensor]:
    """Columns (n, p, k) of each effect that is not windowed and shows in what is compared."""
    for name in likelihood.catalogue:
        if likelihood.windowed(name) is None:
            jacobian = likelihood.jacobian(name, likelihood.start_of(name))
            kept = jacobian[:, :, jacobian.abs().amax((0, 1)) > 1e-12]
            if kept.shape[2]:
                yield kept


def _windows(likelihood: EffectsLikelihood) -> Iterator[tuple[Tensor, Tensor]]:
    """Columns (n, p, s) by band of each windowed effect, and the weights (s, w) by which they make its windows."""
    for name in likelihood.catalogue:
        effect = likelihood.windowed(name)
        if effect is None:
            continue
        weights = _weights(effect, likelihood.compared.state)
        if weights.shape[1]:  # few levels may be narrower than any window
            yield band_columns(likelihood, effect, FIRST_SIZE, likelihood.compared.state), weights


def _weights(effect: WindowedEffect, state: FlightState) -> Tensor:
    """How much of every band (s, w) lies in each window whose ends are :data:`WINDOW_STEP_FL` apart."""
    low_fl, high_fl = effect.range_fl(state)
    ends = torch.arange(low_fl, high_fl + 1e-6, WINDOW_STEP_FL, dtype=torch.float64)
    below = torch.cat(list(effect.below(state, ends).values()), 1)
    height = ends - ends[:, None]
    low, high = ((height >= effect.narrowest_fl) & (height <= effect.longest_fl(state))).nonzero().T
    return (below[high] - below[low]).T
