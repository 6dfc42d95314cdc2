"""Choice of a density: the one under which flights of aircraft that it was not fitted to are most probable.

All kinds of density share the components of the training flights, so that their likelihoods compare. The aircraft are
split three times; each third left out is scored by fits to the others, flight by flight.
"""

import warnings
from collections.abc import Callable

import torch

from descentflow.core.errors import DescentflowWarning
from descentflow.densities.density import Density
from descentflow.densities.kinds import KINDS
from descentflow.training.datamodule import DescentDataModule

SPLITS = 3
"""With a flow's three fits to less than two thirds each, a choice costs less than two fits of a flow."""


@torch.no_grad()
def most_probable(data: DescentDataModule, fitted: Callable[[str, DescentDataModule], Density]) -> tuple[str, str]:
    """Name of the best density by held-out likelihood, and a line that has by how much.

    Args:
        data: Set up, with the training flights.
        fitted: Fits a density of a name to the train part of data.

    Example:
        >>> from descentflow.training.fit import fit
        >>> data = DescentDataModule("descents.parquet")
        >>> data.setup()
        >>> name, why = most_probable(data, lambda name, split: fit(split, "gaussian", final=False).density)
        >>> print(why)  # of three that are alike the first
        chosen of gaussian, mixture, flow: gaussian, by 0.00 +- 0.00 nats a flight over mixture, of held-out aircraft
    """
    names, parts = [kind.name for kind in KINDS], []
    for seed in range(SPLITS):
        split = data.resplit(seed)
        evidence, context = split.evidence("test"), split.contexts("test")
        with warnings.catch_warnings():
            # What a fit to fewer flights warns of is no matter of the one that is made of all.
            warnings.simplefilter("ignore", DescentflowWarning)
            densities = [fitted(name, split) for name in names]
        parts.append(torch.stack([density.log_observed(evidence, context).double() for density in densities]))
    by_flight = torch.cat(parts, 1)
    # The first of those that are level has the fewest parameters.
    first, second = by_flight.mean(1).sort(descending=True, stable=True).indices[:2].tolist()
    gain = by_flight[first] - by_flight[second]
    error = gain.std() / len(gain) ** 0.5
    over = f"{names[first]}, by {gain.mean():.2f} +- {error:.2f} nats a flight over {names[second]}"
    return names[first], f"chosen of {', '.join(names)}: {over}, of held-out aircraft"
