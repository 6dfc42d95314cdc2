"""A classifier that tries to tell samples from held-out flights: its AUC, and the quantities and levels it looks at.

Gradient boosting sees CAS and rate at every few levels. Each flight is paired with a sample that enters as high, and
both are shown at the levels that both have: neither entries nor gaps give a flight away. Pairs are dealt into folds,
and each fold is judged by a classifier that was trained on the others. Flights in place of the samples are the
control: their AUC is 0.5 on average.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from descentflow.evaluation.metrics.descent_set import DescentSet

FOLDS = 5
MIN_PAIRS = 25
"""Fewest flights that are judged: with these the AUC is known to 0.08."""
MAX_PAIRS = 1_000
"""Most flights that are judged, at random: with these the AUC is known to 0.013."""
SHOWN_LEVELS = 40
"""Levels of each quantity that the classifier sees, at the least and if the grid has as many: neighbours are alike."""
BANDS = 8
"""Bands of levels whose importance is reported, of each quantity."""
REPEATS = 4
"""Random exchanges behind each importance."""
SETTINGS: dict[str, Any] = {"max_iter": 50, "max_leaf_nodes": 8, "min_samples_leaf": 10, "early_stopping": False}
"""Of scikit-learn's HistGradientBoostingClassifier: small trees, since a few hundred flights teach it."""
NORMAL_90 = 1.645

Array = NDArray[np.float64]
_Columns = tuple[tuple[str, float, float], NDArray[np.intp]]
"""Name, lowest and highest level, and the columns."""


@dataclass(frozen=True)
class Importance:
    """Loss of AUC when a quantity of some levels is exchanged at random between each flight and its sample.

    Example:
        >>> print(Importance("rate", 310.0, 335.0, loss=0.0512))
        rate FL310-335: 0.05
    """

    quantity: str
    low_fl: float
    high_fl: float
    loss: float

    def __str__(self) -> str:
        """Quantity, levels and loss."""
        return f"{self.quantity} FL{self.low_fl:.0f}-{self.high_fl:.0f}: {self.loss:.2f}"


@dataclass(frozen=True, eq=False)
class Detection:
    """AUC of a classifier of samples and flights.

    Attributes:
        by_flight: (m,) contributions of the flights, each with its sample; their mean is the AUC, and they vary as
            it does when other flights are held out. NaN for flights that were not judged.
        importance: Of all levels of each quantity, then of bands of them; empty if it was not asked for.

    Example:
        >>> detection = Detection(torch.tensor([0.4, 0.6, 0.8, torch.nan]), ())
        >>> round(detection.auc, 3), [round(end, 2) for end in detection.interval]
        (0.6, [0.41, 0.79])
    """

    by_flight: Tensor
    importance: tuple[Importance, ...]

    @property
    def auc(self) -> float:
        """Probability that a flight looks more like a flight than a sample does: 0.5 if they cannot be separated."""
        return float(self.by_flight.nanmean())

    @property
    def interval(self) -> tuple[float, float]:
        """90 % interval over flights, within 0 and 1."""
        judged = self.by_flight[~self.by_flight.isnan()]
        half = NORMAL_90 * float(judged.std()) / max(len(judged), 1) ** 0.5
        return max(self.auc - half, 0.0), min(self.auc + half, 1.0)

    def __str__(self) -> str:
        """AUC, interval, and what the classifier looks at."""
        low, high = self.interval
        line = f"classifier: AUC {self.auc:.2f} [{low:.2f}, {high:.2f}]"
        looked = "; ".join(map(str, self.most_looked_at()))
        return f"{line}; exchanged between flights and samples, the AUC loses {looked}" if looked else line

    def most_looked_at(self) -> list[Importance]:
        """The three bands that matter most, largest first."""
        bands = self.importance[len(QUANTITIES) :]
        return sorted(bands, key=lambda band: -band.loss)[:3]


QUANTITIES = {"CAS": "cas_mps", "rate": "rate_mps"}
"""Features of the classifier: name -> field of the descents. Its trees do not depend on units."""


def classifier_auc(samples: DescentSet, real: DescentSet) -> Tensor:
    """Contributions (m,) of the flights to the AUC, see :class:`Detection`; all NaN with fewer than 25 pairs.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 80, seed=s).trajectories) for s in (1, 2))
        >>> bool(0.2 < classifier_auc(one, two).mean() < 0.8)  # samples of one density
        True
    """
    return detect(samples, real, explain=False).by_flight


def detect(samples: DescentSet, real: DescentSet, seed: int = 0, *, explain: bool = True) -> Detection:
    """Train a classifier to tell samples from flights, fold by fold, and judge it on flights it has not seen.

    The interval is DeLong's (1988) for an AUC, by pairs of a flight and its sample: its coverage of 0.5 for flights
    against flights is part of the tests.

    Args:
        samples: Sampled descents.
        real: Held-out flights on the same grid.
        seed: Of pairs, folds and trees.
        explain: Whether importance is measured.

    Example:
        >>> from dataclasses import replace
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", 80, seed=s).trajectories) for s in (1, 2))
        >>> faster = replace(one, cas_mps=one.cas_mps + 50)
        >>> seen = detect(faster, two)
        >>> seen.auc > 0.95, seen.importance[0].quantity, seen.importance[0].loss > seen.importance[1].loss
        (True, 'CAS', True)
    """
    generator = torch.Generator().manual_seed(seed)
    by_flight = torch.full((len(real),), torch.nan, dtype=torch.float64)
    drawn, judged = pairs_by_entry(samples, real, generator)
    if len(judged) < MIN_PAIRS:
        return Detection(by_flight, ())
    shown = torch.arange(0, real.mask.shape[1], max(real.mask.shape[1] // SHOWN_LEVELS, 1))
    both = samples.mask[drawn][:, shown] & real.mask[judged][:, shown]
    fakes, flights = (_features(side, index, shown, both) for side, index in ((samples, drawn), (real, judged)))
    columns = _columns(real.levels_fl[shown].cpu().numpy()) if explain else []
    losses = np.zeros(len(columns))
    for fold in range(FOLDS):
        test = np.arange(len(judged)) % FOLDS == fold
        model = _trained(flights[~test], fakes[~test], seed)
        inside, auc = contributions(*(_likeness(model, rows[test]) for rows in (flights, fakes)))
        by_flight[judged[torch.from_numpy(test)]] = torch.from_numpy(inside)
        exchanged = _exchanged(model, flights[test], fakes[test], [column[1] for column in columns], seed + fold)
        losses += np.fromiter((auc - exchanged_auc for exchanged_auc in exchanged), float, len(columns)) * test.mean()
    importances = (Importance(*about, loss) for (about, _), loss in zip(columns, losses.tolist(), strict=True))
    return Detection(by_flight, tuple(importances))


def pairs_by_entry(
    samples: DescentSet, real: DescentSet, generator: torch.Generator, most: int = MAX_PAIRS
) -> tuple[Tensor, Tensor]:
    """Positions of samples and flights, paired by the rank of their entry levels, in random order.

    Ranks treat both sides alike, so that for sets of one distribution each of a pair may be either.

    Args:
        samples: Sampled descents.
        real: Flights on the same grid.
        generator: Of the choice and the order.
        most: Most pairs.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> one, two = (DescentSet.of_trajectories(sample("best.ckpt", n, seed=n).trajectories) for n in (50, 40))
        >>> [len(positions) for positions in pairs_by_entry(one, two, torch.Generator().manual_seed(0))]
        [40, 40]
    """
    seen = [torch.nonzero(side.mask.any(1))[:, 0].cpu() for side in (samples, real)]
    n = min(*map(len, seen), most)
    by_entry = []
    for side, positions in zip((samples, real), seen, strict=True):
        chosen = positions[torch.randperm(len(positions), generator=generator)[:n]]
        entry = (side.mask[chosen].cpu() * torch.arange(side.mask.shape[1])).amax(1)
        by_entry.append(chosen[entry.argsort(stable=True)])
    order = torch.randperm(n, generator=generator)
    return by_entry[0][order], by_entry[1][order]


def _features(descents: DescentSet, index: Tensor, shown: Tensor, mask: Tensor) -> Array:
    """(n, quantities x levels) of what both of a pair show, else NaN."""
    parts = [getattr(descents, name)[index][:, shown] for name in QUANTITIES.values()]
    both = torch.cat([torch.where(mask, part, torch.nan) for part in parts], 1)
    return np.asarray(both.double().cpu().numpy())


def _columns(levels_fl: Array) -> list[_Columns]:
    """Name, lowest and highest level, and columns of each quantity, then of each band of it."""
    whole: list[_Columns] = []
    bands: list[_Columns] = []
    for at, name in enumerate(QUANTITIES):
        own = at * len(levels_fl) + np.arange(len(levels_fl))
        for kind, parts in ((whole, [own]), (bands, np.array_split(own, min(BANDS, len(own))))):
            for part in parts:
                ends = levels_fl[part[[0, -1]] % len(levels_fl)]
                kind.append(((name, float(ends[0]), float(ends[1])), part))
    return whole + bands


@functools.cache
def _threads() -> Any:
    """Of the libraries that scikit-learn works by: they are looked for once, in all that the process has loaded."""
    import sklearn.ensemble  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def _trained(flights: Array, samples: Array, seed: int) -> "_Trained":
    # Imported here: it takes longer than most scores.
    from sklearn.ensemble import HistGradientBoostingClassifier

    labels = np.repeat([1, 0], [len(flights), len(samples)])
    values = np.vstack([flights, samples])
    # scikit-learn fails on a level that these folds do not show, or that has one value alone: it teaches nothing.
    columns = np.flatnonzero([len(np.unique(column[~np.isnan(column)])) > 1 for column in values.T])
    if len(columns) == 0:
        return _Trained(None, columns)
    with _threads().limit(limits=1):
        # On a few hundred rows a second thread costs more than it saves.
        model = HistGradientBoostingClassifier(random_state=seed, **SETTINGS).fit(values[:, columns], labels)
    return _Trained(model, columns)


@dataclass(frozen=True, eq=False)
class _Trained:
    """A classifier, and the columns that it was trained on; none where there was nothing to tell."""

    model: Any
    columns: NDArray[np.intp]


def contributions(real: Array, fake: Array) -> tuple[Array, float]:
    """Part (n,) of each pair in the AUC, and the AUC, their mean: DeLong's placements of both, minus their mean.

    Args:
        real: (n,) how much each flight looks like a flight.
        fake: (n,) how much its sample does.

    Example:
        >>> each, auc = contributions(np.array([2.0, 1.0]), np.array([1.0, 0.0]))  # of four comparisons 3.5 are won
        >>> each.tolist(), auc
        ([0.875, 0.875], 0.875)
    """
    wins = (real[:, None] > fake) + 0.5 * (real[:, None] == fake)
    auc = float(wins.mean())
    return wins.mean(1) + wins.mean(0) - auc, auc


def _exchanged(model: Any, flights: Array, samples: Array, parts: list[NDArray[np.intp]], seed: int) -> Iterator[float]:
    """AUC of the fold when the columns of a part no longer tell which of a pair is the flight."""
    chance, sides = np.random.default_rng(seed), np.stack([flights, samples])
    for columns in parts:
        tried = np.repeat(sides[None], REPEATS, 0)
        for pairs in tried:
            rows = np.flatnonzero(chance.random(len(flights)) < 0.5)
            pairs[:, rows[:, None], columns] = sides[::-1, rows[:, None], columns]
        # Judged together: a call costs more than its rows.
        likeness = _likeness(model, tried.reshape(-1, flights.shape[1])).reshape(REPEATS, 2, -1)
        yield float(np.mean([contributions(*pair)[1] for pair in likeness]))


def _likeness(trained: _Trained, values: Array) -> Array:
    if trained.model is None:
        return np.zeros(len(values))
    with _threads().limit(limits=1):
        return np.asarray(trained.model.decision_function(values[:, trained.columns]))
