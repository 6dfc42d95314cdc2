"""Simulated comparisons for NPE: sizes of all effects from a prior, and what two sides of flights would show."""

import torch
from torch import Tensor

from benchmarks.rivals_measured import Measured, filled

REACH = 8.0
"""The prior of a size reaches so many sizes that matter to either side, within its physical bounds."""
POOL = 300
"""Parameters drawn of each effect."""


class Prior:
    """Bounds of all numbers of all effects, one after the other, but of those that say how flights differ."""

    def __init__(self, data: Measured) -> None:
        self.names = list(data.shifts.catalogue)
        self.slots: dict[str, list[int]] = {}
        self.first: list[int] = []
        low: list[float] = []
        high: list[float] = []
        c = data.compared
        bottom, top = c.level_range(c.entries[0])[0], max(c.level_range(e)[1] for e in c.entries)
        for name, effect in data.shifts.catalogue.items():
            self.first.append(len(low))
            self.slots[name] = []
            for parameter in effect.parameters:
                if parameter.from_heterogeneity:
                    continue
                self.slots[name].append(len(low))
                reach = REACH * parameter.scale
                is_level = parameter.unit == "FL"
                low.append(bottom if is_level else max(parameter.low, parameter.start - reach))
                high.append(top if is_level else min(parameter.high, parameter.start + reach))
        self.low, self.high = torch.tensor(low), torch.tensor(high)

    def of(self, data: Measured, name: str, theta: Tensor) -> Tensor:
        """Parameters of one effect, in its own order."""
        effect = data.shifts.catalogue[name]
        found = torch.tensor([p.start for p in effect.parameters], dtype=torch.float64)
        free = [i for i, p in enumerate(effect.parameters) if not p.from_heterogeneity]
        found[free] = theta[self.slots[name]].double()
        # Ends of a window in their order.
        levels = [i for i, p in enumerate(effect.parameters) if p.unit == "FL"]
        if len(levels) == 2:
            found[levels] = found[levels].sort().values
        return found


def simulations(data: Measured, prior: Prior, n: int) -> tuple[Tensor, Tensor]:
    """Parameters (n, k) from the prior, and what two sides of flights with the effects between them would show (n, p).

    Each effect's parameters are drawn from so many of its own that its shifts are computed once; all combinations
    are drawn anew, and so are the flights of both sides, from the simulator's.
    """
    simulated = filled(data.simulated)
    n_real = int(data.compared.real.sum())
    pool = prior.low + (prior.high - prior.low) * torch.rand(POOL, len(prior.low))
    shifts = {
        name: torch.stack([data.few.all_shift(name, prior.of(data, name, one)).mean(0) for one in pool])
        for name in prior.names
    }
    theta, x = torch.empty(n, pool.shape[1]), []
    for i in range(n):
        total = torch.zeros(simulated.shape[1], dtype=torch.float64)
        for name in prior.names:
            at = int(torch.randint(POOL, (1,)))
            theta[i, prior.slots[name]] = pool[at, prior.slots[name]]
            total += shifts[name][at]
        real = simulated[torch.randint(len(simulated), (n_real,))]
        x.append(summary(real + total / data.scale, simulated[torch.randint(len(simulated), (len(simulated),))]))
    return theta, torch.stack(x)


def summary(real: Tensor, simulated: Tensor) -> Tensor:
    """Differences of the means in standard errors (p,): what a set of flights shows of a shift."""
    error = (simulated.var(0) * (1 / len(real) + 1 / len(simulated))).sqrt().clamp(min=1e-6)
    return ((real.mean(0) - simulated.mean(0)) / error).float()
