"""Summary of a prediction for controllers' tools: intervals of the time to each level."""

from collections.abc import Sequence
from statistics import NormalDist

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.core.units import KT_MPS, NM_M
from descentflow.generation.prediction.predictor import Continuations, observed_at
from descentflow.generation.prediction.time_calibration import Control
from descentflow.generation.sample_tables import to_frame
from descentflow.positions.ground_plan import NOWHERE, GroundPlan
from descentflow.representation.profiles import Profiles

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def time_intervals(predictions: Sequence[Continuations], plan: GroundPlan = NOWHERE) -> pl.DataFrame:
    """Quantiles of the seconds, and of the nautical miles, from the last observed level to each level below.

    Args:
        predictions: Continuations of each flight.
        plan: Where they are flown.

    Returns:
        Columns ``flight_id level_fl mean_s q05_s q25_s q50_s q75_s q95_s``, how many ``continuations`` these rest on,
        mean and quantiles in ``..._nm`` of the distance flown, medians ``distance_to_go_nm`` and ``top_of_descent_nm``
        (from the last observed level to the end point), mean ``groundspeed`` (kt), and with a path ``latitude longitude
        track`` at the median distance to go. A row a flight and level, downwards.

    Raises:
        ConfigError: If the wind is stronger than the airspeed.
        DataError: If a field of wind does not hold a place or a time.

    Example:
        >>> from descentflow.generation.prediction.predict import predict
        >>> ahead = predict("best.ckpt", "descents.parquet", from_fl=290, n=50)
        >>> table = time_intervals(ahead.flights)
        >>> table["level_fl"].max(), bool((table["q05_s"] <= table["q95_s"]).all())
        (289, True)
        >>> bool((table["q50_nm"] > 0).all())
        True
    """
    return pl.concat([_intervals(ahead, plan) for ahead in predictions])


def _intervals(ahead: Continuations, plan: GroundPlan) -> pl.DataFrame:
    flown, positions = ahead.trajectories, plan.place(ahead.trajectories)
    below = torch.arange(int(flown.entry[0]) - 1, -1, -1)
    times = _quantiles(flown.time_s[:, below], "s")
    for q in QUANTILES:
        # Errors of reports are normal; continuations spread about their median as drawn.
        off = times[_name(q, "s")] - times["q50_s"]
        noise = ahead.noise_s[below].numpy() * abs(NormalDist().inv_cdf(q)) / NormalDist().inv_cdf(QUANTILES[-1])
        times[_name(q, "s")] = times["q50_s"] + np.sign(q - 0.5) * np.hypot(off, noise)
    distances = _quantiles(torch.from_numpy(positions.distance_m / NM_M)[:, below], "nm")
    to_go_m = np.median(positions.to_go_m, 0)[below]
    ground = {
        "distance_to_go_nm": to_go_m / NM_M,
        "top_of_descent_nm": np.full(len(below), np.median(positions.top_of_descent_m) / NM_M),
        "groundspeed": positions.groundspeed_mps.mean(0)[below] / KT_MPS,
    }
    if plan.path is not None:
        ground |= dict(zip(("latitude", "longitude", "track"), plan.path.at(to_go_m), strict=True))
    levels = flown.levels_fl[below].to(torch.int32).numpy()
    known = {"flight_id": ahead.flight_id, "level_fl": levels, **times, "continuations": len(flown)}
    return pl.DataFrame({**known, **distances, **ground})


def _quantiles(values: Tensor, unit: str) -> dict[str, np.ndarray]:
    """Mean and quantiles over the first dimension by the name of their column."""
    quantiles = values.quantile(torch.tensor(QUANTILES, dtype=values.dtype), dim=0)
    named = {_name(q, unit): row.numpy() for q, row in zip(QUANTILES, quantiles, strict=True)}
    return {f"mean_{unit}": values.mean(0).numpy(), **named}


def _name(quantile: float, unit: str) -> str:
    return f"q{round(100 * quantile):02d}_{unit}"


def continuations_table(predictions: Sequence[Continuations], plan: GroundPlan = NOWHERE) -> pl.DataFrame:
    """Every continuation of every flight, in the columns of samples.

    Args:
        predictions: Continuations of each flight.
        plan: Where they are flown.

    Returns:
        A row for each flight, continuation and level from the last observed one downwards: ``flight_id``, then the
        columns of :func:`~descentflow.generation.sample_tables.to_frame`.

    Raises:
        ConfigError: If the wind is stronger than the airspeed.
        DataError: If a field of wind does not hold a place or a time.

    Example:
        >>> from descentflow.generation.prediction.predict import predict
        >>> ahead = predict("best.ckpt", "descents.parquet", from_fl=290, n=50)
        >>> continuations_table(ahead.flights[:1])["time_s"].min()
        0.0
    """
    return pl.concat(
        [
            to_frame(ahead.trajectories, positions=plan.place(ahead.trajectories)).select(
                pl.lit(ahead.flight_id).alias("flight_id"), pl.all()
            )
            for ahead in predictions
        ]
    )


def actual_times(predictions: Sequence[Continuations], flights: Profiles) -> pl.DataFrame:
    """Rest of flights below the last observed level, for those with every level below it.

    A flight with levels missing below may have been held level or at a selected rate there, which is no free descent.

    Returns:
        Columns ``flight_id level_fl actual_s``.

    Example:
        >>> from descentflow.generation.prediction.predict import predict
        >>> ahead = predict("best.ckpt", "descents.parquet", from_fl=290, n=50)
        >>> times = actual_times(ahead.flights, ahead.observed)
        >>> times.columns, bool((times["actual_s"] > 0).all())
        (['flight_id', 'level_fl', 'actual_s'], True)
    """
    position = {name: i for i, name in enumerate(flights.flight_ids)}
    parts = [pl.DataFrame(schema={"flight_id": pl.String, "level_fl": pl.Int32, "actual_s": pl.Float64})]
    for ahead in predictions:
        i, entry = position[ahead.flight_id], int(ahead.trajectories.entry[0])
        if bool(flights.mask[i, :entry].all()):
            times = flights.time_s[i, :entry] - flights.time_s[i, entry]
            levels = flights.levels_fl[:entry].to(torch.int32).numpy()
            parts.append(pl.DataFrame({"flight_id": ahead.flight_id, "level_fl": levels, "actual_s": times.numpy()}))
    return pl.concat(parts)


def coverage(intervals: pl.DataFrame, actual: pl.DataFrame) -> pl.DataFrame:
    """Errors of forecasts of times, and the share of flights whose time lay inside its 90 % interval, by level.

    Args:
        intervals: From :func:`time_intervals`, or a control's ``q05_s q50_s q95_s``.
        actual: Columns ``flight_id level_fl actual_s``.

    Returns:
        Columns ``level_fl flights covered width_s rms_s``: mean width of the intervals, and root mean square error of
        the medians.

    Example:
        >>> flights = pl.DataFrame({"flight_id": ["a", "b"], "level_fl": [150, 150]})
        >>> intervals = flights.with_columns(q05_s=pl.Series([80.0, 90.0]), q50_s=90.0, q95_s=pl.Series([99.0, 99.0]))
        >>> actual = flights.with_columns(actual_s=pl.Series([85.0, 120.0]))
        >>> coverage(intervals, actual).select("level_fl", "flights", "covered", "width_s").row(0)
        (150, 2, 0.5, 14.0)
    """
    both = intervals.join(actual, on=["flight_id", "level_fl"])
    return (
        both.group_by("level_fl")
        .agg(
            flights=pl.len(),
            covered=pl.col("actual_s").is_between("q05_s", "q95_s").mean(),
            width_s=(pl.col("q95_s") - pl.col("q05_s")).mean(),
            rms_s=(pl.col("q50_s") - pl.col("actual_s")).pow(2).mean().sqrt(),
        )
        .sort("level_fl")
    )


def control_intervals(predictions: Sequence[Continuations], flights: Profiles, control: Control) -> pl.DataFrame:
    """Times by the control for the flights that were observed down to the level that it was fitted from.

    Returns:
        Columns ``flight_id level_fl q05_s q50_s q95_s``.
    """
    last, position = len(control.half_s), {name: i for i, name in enumerate(flights.flight_ids)}
    names = [ahead.flight_id for ahead in predictions if int(ahead.trajectories.entry[0]) == last]
    middle = control.time_s(observed_at(flights.subset([position[name] for name in names]), last)).numpy()
    half, levels = control.half_s.numpy(), flights.levels_fl[:last].to(torch.int32).numpy()
    return pl.DataFrame(
        {
            "flight_id": np.repeat(np.array(names, dtype=str), last),
            "level_fl": np.tile(levels, len(names)),
            "q05_s": (middle - half).ravel(),
            "q50_s": middle.ravel(),
            "q95_s": (middle + half).ravel(),
        }
    )
