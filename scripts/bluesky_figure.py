"""Draw real descents beside those of simulators by flight level: rate of descent, CAS, and the air that TAS implies."""

import argparse
from pathlib import Path

import matplotlib
import numpy as np
import polars as pl
import torch
from matplotlib.axes import Axes

from descentflow.core.files import whole_file
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.airspeed import mach_to_tas_mps

BAND_FL = 20
MIN_FLIGHTS = 5
LINES = ("-", "--", ":", "-.", (0, (1, 1)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--real", type=Path, required=True, help="prepared descents")
    parser.add_argument("--simulator", nargs=2, action="append", required=True, metavar=("NAME", "DESCENTS"))
    parser.add_argument("--out", type=Path, required=True, help="a .png file")
    args = parser.parse_args()
    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 3, figsize=(11, 4.6), sharey=True, layout="constrained")
    sides = [("real flights", args.real), *((name, Path(path)) for name, path in args.simulator)]
    for number, (name, path) in enumerate(sides):
        draw(axes, bands(pl.read_parquet(path)), name, number)
    labels = ("rate of descent, ft/min", "CAS, kt", "temperature that TAS and Mach imply, ISA + K")
    for axis, label in zip(axes, labels, strict=True):
        axis.set_xlabel(label)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("flight level")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=min(len(sides), 3))
    with whole_file(args.out) as temporary:
        figure.savefig(temporary, format="png", dpi=110)
    print(f"wrote {args.out}")


def bands(frame: pl.DataFrame) -> pl.DataFrame:
    """Mean and spread over flights of each quantity, by band of altitude, where enough flights show it."""
    height = frame["level_fl"].to_numpy() * FL_M
    standard_k = np.maximum(288.15 - 0.0065 * height, 216.65)
    mach = frame["Mach"].to_numpy().astype(float)
    still = mach_to_tas_mps(torch.from_numpy(mach), torch.from_numpy(height)).numpy() / KT_MPS
    tas = frame["TAS"].to_numpy().astype(float) if "TAS" in frame.columns else np.full(len(frame), np.nan)
    rows = frame.with_columns(
        (pl.col("level_fl") // BAND_FL * BAND_FL + BAND_FL / 2).alias("band"),
        (-pl.col("vertical_rate")).alias("rate"),
        pl.Series("warmer", standard_k * ((tas / still) ** 2 - 1)).fill_nan(None),
    )
    names = ("rate", "IAS", "warmer")
    by_flight = rows.group_by("band", "flight_id").agg([pl.col(name).mean() for name in names])
    cells = [pl.col(n).mean().alias(n) for n in names] + [pl.col(n).std().alias(f"{n}_sd") for n in names]
    counts = [pl.col(n).count().alias(f"{n}_n") for n in names]
    return by_flight.group_by("band").agg(cells + counts).sort("band")


def draw(axes: list[Axes], table: pl.DataFrame, name: str, number: int) -> None:
    """One side: a line, and for the first the spread between flights."""
    color = "black" if number == 0 else f"C{number - 1}"
    for axis, quantity in zip(axes, ("rate", "IAS", "warmer"), strict=True):
        seen = table.filter(pl.col(f"{quantity}_n") >= MIN_FLIGHTS)
        level, mean, spread = (seen[c].to_numpy() for c in ("band", quantity, f"{quantity}_sd"))
        style = LINES[number % len(LINES)]
        axis.plot(mean, level, linestyle=style, color=color, linewidth=2.2 - 0.2 * number, label=name)
        if number == 0:
            axis.fill_betweenx(level, mean - spread, mean + spread, color="grey", alpha=0.25, linewidth=0)


if __name__ == "__main__":
    main()
