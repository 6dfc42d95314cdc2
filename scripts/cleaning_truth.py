"""Cleaning judged by simulated flights of which the truth is known: what it finds, what it costs, what bias it leaves.

python scripts/cleaning_truth.py
"""

import numpy as np
import polars as pl

import descentflow as df
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.surveillance.cleaning.chain import after_rates, before_rates
from descentflow.surveillance.cleaning.rates import with_rate
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.rows.drop_report import DropReport

FLIGHTS, SEED = 1500, 11


def main() -> None:
    """Print shares of rows by their true label, and errors on levels."""
    world = df.simulate("A320", FLIGHTS, SEED)
    for kind, rows in (("reported rates", world.rows), ("differenced", world.rows.drop("vertical_rate"))):
        reasons = fates(rows, world.truth.sort("timestamp"))
        level, idle = reasons.filter(label="level_off")["reason"], reasons.filter(label="idle")["reason"]
        held, taken = reasons.filter(label="constant_rate")["reason"], reasons.filter(reason="constant_rate")["label"]
        slow = reasons.filter(reason="not_descending")["label"]
        print(
            f"{kind}: of level-offs {level.is_not_null().mean():.3f} go; of managed rows "
            f"{(held == 'constant_rate').sum() / len(held):.2f} go as such, {(taken == 'constant_rate').mean():.2f} of "
            f"what goes as such; of idle rows {(idle == 'constant_rate').sum() / len(idle):.1%}; "
            f"{slow.is_in(['idle', 'constant_rate']).sum()} idle or managed rows go as level-offs"
        )
    descents = df.prepare(world.rows, cleaning=Cleaning(bottom_fl=100)).frame
    truths = {
        name: own for (name,), own in world.truth.sort("timestamp").partition_by("flight_id", as_dict=True).items()
    }
    errors = pl.concat(errors_of(flight, truths[name]) for (name,), flight in descents.group_by("flight_id"))
    for name in errors.columns:
        print(f"error on levels, {name}: mean {errors[name].mean():.3f}, spread {errors[name].std():.2f}")


def fates(rows: pl.DataFrame, truth: pl.DataFrame) -> pl.DataFrame:
    """Each row's true label and the reason for which it was dropped (null if kept)."""
    labels = truth.select("flight_id", "timestamp", pl.col("label").cast(pl.String))
    rows = rows.sort("timestamp").join_asof(
        labels, on="timestamp", by="flight_id", strategy="nearest", check_sortedness=False
    )
    left = rows.sort("flight_id", "timestamp").with_row_index("row")
    labelled, dropped = left.select("row", "label"), pl.DataFrame(schema={"row": pl.UInt32, "reason": pl.String})
    for step in (*before_rates(Cleaning()), *after_rates(Cleaning())):
        before = left = with_rate(left)
        left = step(left, DropReport())
        gone = before.join(left, on="row", how="anti").select("row", pl.lit(step.reason).alias("reason"))
        dropped = pl.concat([dropped, gone])
    return labelled.join(dropped, on="row", how="left")


def errors_of(levels: pl.DataFrame, truth: pl.DataFrame) -> pl.DataFrame:
    """Errors of time, CAS and rate on the levels of a flight, whose truth is sorted by time."""
    level = levels["level_fl"].to_numpy()
    lowest = np.minimum.accumulate(truth["altitude_m"].to_numpy()) / FL_M
    seconds = truth["timestamp"].dt.epoch("us").to_numpy() / 1e6

    def true(values: np.ndarray) -> np.ndarray:
        return np.interp(-level, -lowest, values)

    return pl.DataFrame(
        {
            "time_s": levels["timestamp"].dt.epoch("us").to_numpy() / 1e6 - true(seconds),
            "cas_kt": levels["IAS"].to_numpy() - true(truth["cas_mps"].to_numpy()) / KT_MPS,
            "rate_fpm": levels["vertical_rate"].to_numpy() - true(truth["rate_mps"].to_numpy()) / FPM_MPS,
        }
    )


if __name__ == "__main__":
    main()
