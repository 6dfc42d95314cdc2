"""Samples against real flights of aircraft that were held out, against generators without physics and other programs.

Types of a family of several places are one fleet. Its aircraft are dealt to folds; each fold is judged by models of the
others, on their levels. A flight is judged by the time over its longest stretch of whole thousands of feet: the CRPS in
percent of that time, the log density of its logarithm (a kernel through the draws), and whether the 90 % interval holds
it. Aircraft can be dealt several times: each flight is then judged by as many refits, and its scores are their means.
"""

import importlib
import warnings
from collections.abc import Callable, Mapping
from functools import cache, partial

import numpy as np
import polars as pl
from numpy.typing import NDArray

from benchmarks.fidelity import of_profiles, on_edges, sampled
from benchmarks.fidelity_rivals import smoothed_bootstrap
from benchmarks.fidelity_vectors import Array, Vectors
from benchmarks.real_rivals import node_fdm
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_typecodes
from descentflow.core.units import FL_M
from descentflow.representation.profiles import profiles_from_frame
from descentflow.surveillance.descents.prepared_descents import Descents, top_levels
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.fit import fit
from studies.aircraft.real_runs import runs_of

FAMILIES = {"A320": ("A318", "A319", "A320", "A321", "A20N", "A21N"), "B738": ("B736", "B737", "B738", "B739", "B38M")}
"""Type whose coefficients the fleet has, and its types."""
FOLDS, DRAWS, WRAP_DRAWS = 8, 1000, 60
BOTTOM_FL, TOP_FL = 100, 400
"""Of the levels judged: the vectors of all generators begin at the same one."""
FEWEST_BINS = 4
"""Thousands of feet of a stretch at least."""
FEWEST_SHOWN = 2
"""Flights that show the highest bin of which a generator without physics is made."""
RESAMPLES = 2000
"""Fleets of aircraft drawn anew, for intervals."""
BASELINE, DEFAULT = "smoothed bootstrap", "default"

Answer = Callable[[pl.DataFrame, NDArray[np.intp]], Array]
"""Seconds over a stretch of bins, as often as they are drawn, of the flight whose rows are given."""
Scores = dict[str, dict[str, list[tuple[float, float, float]]]]
"""By generator and flight, one for each deal: CRPS, log score and hit, NaN where it has no draw over the levels."""


def print_fidelity(
    places: Mapping[str, Descents], models: tuple[str, ...], seed: int, deals: int, *, ask_node_fdm: bool
) -> None:
    """Print a table for each family that has enough aircraft."""
    for code, types in FAMILIES.items():
        fleet = pooled(places, code, types)
        owner = dict(fleet.frame.select("flight_id", "icao24").unique().iter_rows())
        if len(set(owner.values())) < 2 * FOLDS:
            print(f"{code} family: {len(set(owner.values()))} aircraft, too few")
            continue
        scores: Scores = {}
        for deal in range(deals):
            judge(fleet, code, models, seed + deal, scores, ask_node_fdm=ask_node_fdm)
        flights = list(scores[BASELINE])
        tails = [owner[name] for name in flights]
        print(f"\n{code} family: {len(set(tails))} aircraft, {len(tails)} flights judged, {FOLDS} folds, {deals} deals")
        means = {name: np.array([np.mean(by[place], 0) for place in flights]) for name, by in scores.items()}
        for name, values in means.items():
            crps, log, held = values.T
            more, gain = (by_aircraft((values - means[BASELINE])[:, i], tails) for i in (0, 1))
            print(
                f"  {name:<19} CRPS {np.nanmean(crps):4.1f} % of the time, {more} over the bootstrap's; log score "
                f"{_shown(log, '{:.2f}')}, {gain}; 90 % intervals hold {_shown(100 * held, '{:.0f} %')}",
                flush=True,
            )


def _shown(values: Array, form: str) -> str:
    return form.format(np.nanmean(values)) if np.isfinite(values).any() else "none"


def pooled(places: Mapping[str, Descents], code: str, types: tuple[str, ...]) -> Descents:
    """Descents of all places as one fleet of one type; ``own_type`` keeps theirs."""
    frames = [
        held.frame.filter(pl.col("typecode").is_in(types)).with_columns(
            pl.col("flight_id") + f" {place}", own_type=pl.col("typecode"), typecode=pl.lit(code)
        )
        for place, held in places.items()
    ]
    frame = pl.concat(frames, how="diagonal_relaxed").drop("Mach", strict=False)
    return Descents(frame, {**next(iter(places.values())).metadata, "top_fl": top_levels(frame)})


def judge(
    fleet: Descents, code: str, models: tuple[str, ...], seed: int, scores: Scores, *, ask_node_fdm: bool
) -> None:
    """Add the scores of one deal of the aircraft to folds."""
    frame, bottom = fleet.frame, fleet.bottom_fl
    tails = np.random.default_rng(seed).permutation(frame["icao24"].unique().sort().to_numpy())
    for fold in range(FOLDS):
        out = pl.col("icao24").is_in(tails[fold::FOLDS].tolist())
        train, test = frame.filter(~out), frame.filter(out)
        judged = profiles_from_frame(test, open_aircraft(code), bottom)
        flights = of_profiles(judged)
        answers, n_bins = generators(Descents(train, fleet.metadata), code, models, seed, flights.edges_fl)
        if ask_node_fdm:
            answers["node-fdm"] = partial(_by_node_fdm, flights.edges_fl)
        for row, name in enumerate(judged.flight_ids):
            bins = longest(np.isfinite(flights.log_s[row, :n_bins]))
            if len(bins) < FEWEST_BINS:
                continue
            rows = test.filter(pl.col("flight_id") == name)
            seconds = float(np.exp(flights.log_s[row, bins]).sum())
            for generator, answer in answers.items():
                times = answer(rows, bins)
                own = scored(times[np.isfinite(times)], seconds)
                scores.setdefault(generator, {}).setdefault(name, []).append(own)


def generators(
    train: Descents, code: str, models: tuple[str, ...], seed: int, edges_fl: Array
) -> tuple[dict[str, Answer], int]:
    """Generators fitted to the flights, and OpenAP's; and the number of bins, from the bottom up, that all have."""
    data = DescentDataModule(train, test_fraction=0.0, validation_fraction=0.0)
    drawn: dict[str, Answer] = {}
    for name in models:
        density = fit(data, None if name == DEFAULT else name, seed=seed, final=False).density.eval()
        drawn[name] = _drawn(sampled(density, DRAWS, seed)[0], edges_fl)
    known = shown_by_some(of_profiles(data.profiles("train")))
    drawn[BASELINE] = _drawn(smoothed_bootstrap(known, DRAWS, seed), edges_fl)
    drawn["OpenAP's WRAP"] = lambda rows, bins: _drawn(wrap(rows["own_type"][0], seed), edges_fl)(rows, bins)
    return drawn, known.log_s.shape[1]


def _drawn(vectors: Vectors, edges_fl: Array) -> Answer:
    log_s = on_edges(vectors, edges_fl).log_s
    return lambda _, bins: np.exp(log_s[:, bins]).sum(1)


def shown_by_some(of: Vectors) -> Vectors:
    """The same up to the highest bin that two flights show."""
    n = int(np.flatnonzero(np.isfinite(of.log_s).sum(0) >= FEWEST_SHOWN)[-1]) + 1
    return Vectors(of.edges_fl[: n + 1], of.cas_kt[:, : n + 1], of.log_s[:, :n], of.entry_fl)


def longest(shown: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Positions of the longest run of true values.

    Example:
        >>> longest(np.array([True, False, True, True]))
        array([2, 3])
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], shown, [False]]).astype(int)))
    begins, ends = edges[::2], edges[1::2]
    if not len(begins):
        return np.zeros(0, dtype=np.intp)
    best = int((ends - begins).argmax())
    return np.arange(begins[best], ends[best])


def scored(times: Array, seconds: float) -> tuple[float, float, float]:
    """CRPS in percent of the time, log density of its logarithm, and 1.0 if the 90 % interval holds it.

    A single time has an absolute error as its CRPS, and neither density nor interval.

    Example:
        >>> crps, log, held = scored(np.exp(np.random.default_rng(0).normal(6.0, 0.1, 4000)), float(np.exp(6.0)))
        >>> round(crps, 1), round(log, 1), held  # of a normal error of 10 %: 0.234 sigma, and ln of its density
        (2.4, 1.3, 1.0)
    """
    n = len(times)
    if not n:
        return float("nan"), float("nan"), float("nan")
    ordered = np.sort(times)
    spread = 2 * float(((2 * np.arange(n) - n + 1) * ordered).sum()) / max(n * (n - 1), 1)
    crps = 100 * (float(np.abs(ordered - seconds).mean()) - spread / 2) / seconds
    if n == 1:
        return crps, float("nan"), float("nan")
    logs, at = np.log(ordered), np.log(seconds)
    width = max(1.06 * float(logs.std()) * n**-0.2, 1e-3)
    density = float(np.exp(-0.5 * ((at - logs) / width) ** 2).mean()) / (width * (2 * np.pi) ** 0.5)
    low, high = np.quantile(ordered, [0.05, 0.95])
    return crps, float(np.log(max(density, 1e-9))), float(low <= seconds <= high)


def _by_node_fdm(edges_fl: Array, rows: pl.DataFrame, bins: NDArray[np.intp]) -> Array:
    """Seconds by node-fdm; none of a type whose speeds no open aircraft knows, or that it has no model of."""
    if rows["own_type"][0] not in open_typecodes():
        return np.zeros(0)
    bottom_fl, top_fl = edges_fl[bins[0]], edges_fl[bins[-1] + 1]
    part = rows.filter(pl.col("level_fl").is_between(bottom_fl, top_fl)).with_columns(typecode="own_type")
    runs = [flight for flight in runs_of(part, "") if len(flight.levels_fl) == top_fl - bottom_fl + 1]
    return np.array([(1 + node_fdm(flight)) * flight.seconds for flight in runs])


@cache
def wrap(typecode: str, seed: int) -> Vectors:
    """Descents of OpenAP's kinematic model (WRAP) with its parameters drawn, in bins of 1,000 ft."""
    openap = importlib.import_module("openap")
    edges = np.arange(BOTTOM_FL, TOP_FL + 1.0, 10.0)
    state = np.random.get_state()  # noqa: NPY002 - OpenAP draws from the global state
    np.random.seed(seed)  # noqa: NPY002
    logs = []
    with warnings.catch_warnings(action="ignore"):  # an A320's numbers stand for others
        generator = openap.FlightGenerator(ac=typecode, use_synonym=True)
        for _ in range(WRAP_DRAWS):
            flown = generator.descent(dt=2, random=True)
            height, seconds = flown["h"].to_numpy() / FL_M, flown["t"].to_numpy()
            falls = np.concatenate([[True], np.diff(height) < 0])
            at = np.interp(edges, height[falls][::-1], seconds[falls][::-1], left=np.nan, right=np.nan)
            logs.append(np.log(np.maximum(-np.diff(at), 1e-9)))
    np.random.set_state(state)  # noqa: NPY002
    cas = np.full((WRAP_DRAWS, len(edges)), np.nan)
    return Vectors(edges, cas, np.array(logs), np.full(WRAP_DRAWS, float(TOP_FL)))


def by_aircraft(values: Array, owners: list[str]) -> str:
    """Mean, and its 90 % interval by whole aircraft drawn anew."""
    known = np.isfinite(values)
    if not known.any():
        return "none"
    names, index = np.unique(np.array(owners)[known], return_inverse=True)
    sums, counts = np.bincount(index, values[known]), np.bincount(index).astype(float)
    drawn = np.random.default_rng(0).integers(0, len(names), (RESAMPLES, len(names)))
    low, high = np.quantile(sums[drawn].sum(1) / counts[drawn].sum(1), [0.05, 0.95])
    return f"{values[known].mean():+.2f} ({low:+.2f} to {high:+.2f})"
