"""Draws as descents: corrected where the checkpoint has a correction, and checked by the bounds."""

from collections.abc import Callable

import numpy as np
import torch

from descentflow.core.counter_random import DrawNumbers
from descentflow.generation.conditional.flown_profiles import FlownProfiles
from descentflow.generation.conditional.latent_draws import Drawn
from descentflow.representation.decoder.trajectories import Trajectories, concatenate
from descentflow.representation.plausibility import RULES
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Representation

Judge = Callable[[Drawn, np.ndarray], np.ndarray]
"""Rules (n, r) that draws break; the second argument is each draw's number."""


class DrawnDescents:
    """Draws on a grid as descents of a representation.

    Example:
        >>> import numpy as np
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.conditional.latent_profiles import Curves
        >>> from descentflow.generation.conditional.point_condition import Flown
        >>> parts = load_model("best.ckpt").representation
        >>> grid, mean = FlownProfiles(parts.decoder), torch.zeros(1, parts.decoder.dimension).double()
        >>> curves = Curves(*(grid.columns(values.numpy()) for values in parts.decoder.profiles(mean)))
        >>> drawn = Drawn(np.zeros((1, 4)), np.array([100]), Flown.of(grid, curves), np.zeros(1))
        >>> descents = DrawnDescents(parts, grid, seed=0)
        >>> float(descents.of(drawn, np.array([0])).time_s[0, 100]), descents.broken(drawn, np.array([0])).any()
        (0.0, np.False_)
    """

    def __init__(self, representation: Representation, grid: FlownProfiles, seed: int) -> None:
        """Hold the parts; ``seed`` is that of corrections."""
        self.decoder, self.bounds = representation.decoder, representation.plausibility
        self.correction = representation.correction
        self.grid, self.seed = grid, seed

    def of(self, drawn: Drawn, which: np.ndarray) -> Trajectories:
        """The descents; where there is a correction, each is corrected by its number (n,)."""
        flown = self._trajectories(drawn)
        correction = self.correction
        if correction is None:
            return flown
        parts = [
            correction.apply(self.decoder.aircraft, flown.subset(torch.tensor([i])), DrawNumbers(self.seed, int(k)))
            for i, k in enumerate(which)
        ]
        return concatenate(parts)

    def broken(self, drawn: Drawn, which: np.ndarray) -> np.ndarray:
        """Mask (n, r) of the rules that draws break."""
        found: np.ndarray = self.bounds.broken_rules(self.of(drawn, which)).numpy()
        return found

    def broken_after(self, so_far: Profiles) -> Judge:
        """The same after a part was flown: only whether they descend all the way, as prediction asks."""
        n_levels = self.grid.n_levels

        def broken(drawn: Drawn, which: np.ndarray) -> np.ndarray:
            below = np.arange(n_levels) <= drawn.entry[:, None]
            rules = np.zeros((len(which), len(RULES)), dtype=bool)
            rules[:, RULES.index("descends_too_slowly")] = (~(drawn.flown.rate[:, :n_levels] < 0) & below).any(1)
            return rules

        return broken

    def _trajectories(self, drawn: Drawn) -> Trajectories:
        n_levels, flown = self.grid.n_levels, drawn.flown
        time_s = flown.seconds - flown.seconds[np.arange(len(drawn.entry)), drawn.entry][:, None]
        cas, mach, tas, rate, drag = (
            torch.from_numpy(np.ascontiguousarray(values[:, :n_levels]))
            for values in (flown.cas, flown.mach, flown.tas, flown.rate, flown.drag)
        )
        levels_fl = self.decoder.levels_fl
        entry = torch.from_numpy(drawn.entry.astype(np.int64))
        return Trajectories(levels_fl, entry, torch.from_numpy(time_s), cas, mach, tas, rate, drag)
