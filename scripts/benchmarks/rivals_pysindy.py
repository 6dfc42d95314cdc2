"""PySINDy: which terms a sparse regression keeps in the residual of the rate, set up as in its documentation.

The residual is the real flights' ln rate over the polar's minus the simulator's mean of it, by flight and by band of
altitude. The library holds each effect's own signature there, more than a user of PySINDy has, a constant and the
altitude. Columns are normalised and coefficients bagged (`STLSQ(normalize_columns=True)` inside
`EnsembleOptimizer(bagging=True)`), as advised for noisy data. The threshold is the one with the best score on flights
left out, as advised for choosing it; one above all coefficients is among them, and means that nothing is named.
"""

import warnings

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from benchmarks.rivals_measured import Measured
from benchmarks.rivals_scoring import Answer

Array = NDArray[np.float64]

THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1e9)
"""In units of the residual's norm, for normalised columns."""
RIDGE = 0.05
MODELS = 20
FOLDS = 5
WINDOWS = 7
"""Windows of altitude tried for an effect that has one."""
MIN_INCLUSION = 0.6
"""Share of the bagged models that must keep a term (E-SINDy's own examples take 0.6)."""


def answer(data: Measured, seed: int) -> Answer:
    """Answer of PySINDy."""
    names, columns, residual, flight = rate_library(data)
    if not names:
        return Answer(gap=None)
    fold = np.random.default_rng(seed).permutation(flight.max() + 1)[flight] % FOLDS
    scores = []
    for threshold in THRESHOLDS:
        parts = [_score(columns, residual, fold == k, threshold, seed) for k in range(FOLDS) if (fold == k).sum() > 0]
        scores.append(float(np.mean(parts)))
    best = THRESHOLDS[int(np.argmax(scores))]
    coefficients, inclusion = _fitted(columns, residual, best, seed)
    size = np.abs(coefficients) * np.sqrt((columns**2).mean(0))
    kept = [i for i in np.argsort(-size) if inclusion[i] >= MIN_INCLUSION and size[i] > 0]
    named = tuple(frozenset({names[i]}) for i in kept if not names[i].startswith("("))
    return Answer(named, gap=bool(kept), unknown=bool(kept) and not named)


def rate_library(data: Measured) -> tuple[list[str], Array, Array, NDArray[np.int64]]:
    """Names of terms, columns (samples, terms), residual (samples,) and flight (samples,) where the rate was seen.

    Each effect's column is its sensitivity to its first number; of the effects with windows, at the start that explains
    most. Terms in brackets are no effects.
    """
    c = data.compared
    at = c.columns("rate")
    real = c.real
    residual = (c.y[real] - c.y[~real].nanmean(0))[:, at]
    seen = residual.isfinite()
    flight = torch.arange(len(residual))[:, None].expand_as(seen)[seen].numpy()
    target = residual[seen].numpy()
    names, columns = ["(constant)", "(altitude)"], [np.ones(len(target))]
    middle = torch.tensor([c.level_range(c.entries[i])[0] for i in at.tolist()], dtype=torch.float64)
    altitude = ((middle - middle.mean()) / middle.std())[None].expand_as(seen)
    columns.append(altitude[seen].numpy())
    for name in data.shifts.catalogue:
        options = [data.shifts.jacobian(name, start)[real][:, at, 0][seen].numpy() for start in starts(data, name)]
        options = [column for column in options if np.linalg.norm(column) > 1e-9]
        if options:
            names.append(name)
            columns.append(max(options, key=lambda column: abs(column @ target) / np.linalg.norm(column)))
    return names, np.stack(columns, 1), target, flight


def starts(data: Measured, name: str) -> list[Tensor]:
    """Places at which an effect's sensitivity is taken: one, or windows a third of the grid high that tile it."""
    start = data.shifts.start_of(name)
    ends = [i for i, p in enumerate(data.shifts.catalogue[name].parameters) if p.unit == "FL"]
    if len(ends) != 2:
        return [start]
    c = data.compared
    low, high = c.level_range(c.entries[0])[0], max(c.level_range(entry)[1] for entry in c.entries)
    found = []
    for place in range(WINDOWS):
        bottom = low + place * (high - low) / (WINDOWS + 2)
        window = start.clone()
        window[ends[0]], window[ends[1]] = bottom, bottom + (high - low) * 3 / (WINDOWS + 2)
        found.append(window)
    return found


def _fitted(columns: Array, residual: Array, threshold: float, seed: int) -> tuple[Array, Array]:
    """Median coefficients and shares of bagged models that keep each term."""
    import pysindy

    np.random.seed(seed)  # noqa: NPY002 - PySINDy draws from it
    # A threshold is of normalised columns: made one of the share that a term has in the residual.
    scale = float(np.linalg.norm(residual))
    optimizer = pysindy.EnsembleOptimizer(
        opt=pysindy.STLSQ(threshold=threshold * scale, alpha=RIDGE, normalize_columns=True),
        bagging=True,
        n_models=MODELS,
    )
    model = pysindy.SINDy(optimizer=optimizer, feature_library=pysindy.IdentityLibrary())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # The constant is the state, whose derivative is known; the other terms are its controls.
        model.fit(columns[:, :1], t=1.0, x_dot=residual[:, None], u=columns[:, 1:])
    kept = np.array(optimizer.coef_list)[:, 0]
    return np.median(kept, 0), (kept != 0).mean(0)


def _score(columns: Array, residual: Array, out: NDArray[np.bool_], threshold: float, seed: int) -> float:
    """Share of the residual's square explained in flights left out."""
    coefficients, _ = _fitted(columns[~out], residual[~out], threshold, seed)
    rest = residual[out] - columns[out] @ coefficients
    return 1.0 - float(rest @ rest) / float(residual[out] @ residual[out])
