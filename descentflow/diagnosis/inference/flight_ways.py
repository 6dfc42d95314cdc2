"""Ways of an effect beside flights: what each way explains of what is left of them, and what is expected of it."""

from collections.abc import Sequence

import torch
from torch import Tensor

from descentflow.diagnosis.inference.flight_laws import WaysTaken
from descentflow.diagnosis.inference.size_in_ways import Explained
from descentflow.diagnosis.inference.two_sides import Entry
from descentflow.diagnosis.inference.whitening import Whitening
from descentflow.effects.flight_law import Ways


class WaysOfFlights:
    """Ways of an effect beside the flights that may have it, with all that does not depend on what is left of them.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.diagnosis.inference.whitening import whiten
        >>> from descentflow.effects import EFFECTS
        >>> theta = torch.tensor([0.4, 200.0, 240.0, 1.0, 0.0, 20.0, 10.0, 0.1]).double()
        >>> brakes, sides = EFFECTS["speed_brake"], example_sides(EFFECTS["speed_brake"], theta.tolist())
        >>> weights = whiten(sides.y, sides.real, sides.airframe, sides.nugget(), sides.of_flight())
        >>> ways = WaysOfFlights(brakes.ways(sides.state, theta, torch.zeros(1)), sides.entries, weights)
        >>> found = ways.explained(sides.y).under(0.4, 0.1).log_ratio.amax(1)
        >>> found[sides.real].mean() > found[~sides.real].mean()  # the real flights have brakes out
        tensor(True)
    """

    def __init__(self, ways: Ways, entries: Sequence[Entry], whitening: Whitening) -> None:
        """Find the slots among the entries, and work out the curvatures.

        Args:
            ways: Of the flights.
            entries: What is compared; slots that are not are left out.
            whitening: Precision of the flights.
        """
        number = {(entry.quantity, entry.band): i for i, entry in enumerate(entries)}
        kept = [k for k, slot in enumerate(ways.slots) if slot in number]
        self.at = torch.tensor([number[ways.slots[k]] for k in kept], dtype=torch.long)
        self.whitening, self.n_entries = whitening, len(entries)
        self.shape, self.offset = ways.shape[:, kept], ways.offset[:, kept]
        self.weights = (ways.table[ways.upper] - ways.table[ways.lower])[:, kept]
        self.rows = whitening.of_entries(self.at)
        self.pushed = self.weighted(self.placed(self.offset)) if bool(self.offset.any()) else self.offset
        self.curvature = self._curvature()

    def weighted(self, rest: Tensor) -> Tensor:
        """Precision times what is left of flights (n, p), zero where nothing was seen, at the slots: (n, S)."""
        return self.whitening.apply(rest)[:, self.at]

    def weighted_alike(self, rest: Tensor) -> Tensor:
        """The same of what is left of every flight alike (p,)."""
        return (self.rows @ rest)[self.whitening.pattern]

    def explained(self, rest: Tensor) -> Explained:
        """What the ways explain of what is left of flights (n, p), zero where nothing was seen."""
        return self.explained_of(self.weighted(rest))

    def explained_of(self, weighted: Tensor) -> Explained:
        """The same, given :meth:`weighted` (n, S)."""
        by_offset = (self.offset * (weighted - 0.5 * self.pushed)).sum(1)
        return Explained((self.shape * (weighted - self.pushed)) @ self.weights.T, self.curvature, by_offset)

    def at_slots(self, taken: WaysTaken) -> Tensor:
        """Shift (n, S) at the slots that is expected of ways which are as likely as said, and of their sizes there."""
        sized = taken.placed(taken.probability * taken.size)
        return self.shape * (sized @ self.weights) + taken.share[:, None] * self.offset

    def summed(self, slots: Tensor) -> Tensor:
        """Sum (p,) over flights of the precision times a shift (n, S) at the slots."""
        by_pattern = torch.zeros(len(self.rows), slots.shape[1], dtype=slots.dtype)
        by_pattern.index_add_(0, self.whitening.pattern, slots)
        return by_pattern.flatten() @ self.rows.flatten(0, 1)

    def _curvature(self) -> Tensor:
        """Curvatures (n, W): products of slots, which all ways have in common, weighed by each."""
        first, second = torch.triu_indices(len(self.at), len(self.at))
        block = self.rows[:, first, self.at[second]][self.whitening.pattern]
        by_slot = self.weights.T.contiguous()
        pairs = by_slot[first] * by_slot[second] * torch.where(first == second, 1.0, 2.0)[:, None]
        return (block * self.shape[:, first] * self.shape[:, second] @ pairs).clamp_(min=0.0)

    def placed(self, slots: Tensor) -> Tensor:
        """Values (n, S) of slots at their entries (n, p)."""
        placed = torch.zeros(len(slots), self.n_entries, dtype=slots.dtype)
        placed[:, self.at] = slots
        return placed
