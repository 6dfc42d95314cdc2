"""`descentflow predict-descent`: the rest of observed descents, from their first part."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from descentflow.representation.profiles import Profiles
    from descentflow.training.datamodule import DescentDataModule


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Predict descents from the part at and above a flight level: intervals of the time to each level below, and on "
        "request the probability of being at each level over time. Where the descents go on below that level, the "
        "share of flights inside their intervals is printed too."
    )
    parser.add_argument("checkpoint", type=Path, help="checkpoint that `descentflow fit` wrote (.ckpt)")
    parser.add_argument("descents", type=Path, help="prepared descents (descentflow prepare)")
    parser.add_argument("--from-fl", type=float, required=True, help="last level that counts as observed")
    parser.add_argument(
        "--flight", action="append", help="flight_id; may be given again (default: every unseen flight)"
    )
    parser.add_argument("-n", "--number", type=int, default=500, help="continuations a flight (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="the same seed gives the same predictions (default: 0)")
    parser.add_argument(
        "--context-table", type=Path, help="CSV or Parquet with flight_id and the context, for a conditional model"
    )
    parser.add_argument("--out", type=Path, required=True, help="table of time intervals (.parquet)")
    parser.add_argument("--occupancy", type=Path, help="also write the occupancy of levels (.parquet)")
    parser.add_argument("--step-s", type=float, default=10.0, help="step of the occupancy's time (default: 10)")


def run(args: argparse.Namespace) -> None:
    """Calibrate, predict, write, and compare with what came."""
    from tqdm import tqdm

    from descentflow.core.errors import ConfigError, DataError, SamplingError
    from descentflow.core.files import check_output, whole_file
    from descentflow.core.threads import one_thread_unless_told
    from descentflow.densities.checkpoint import load_model
    from descentflow.generation.prediction.predictor import DescentPredictor
    from descentflow.generation.prediction.summary import actual_times, coverage, occupancy_table, time_intervals
    from descentflow.training.datamodule import DescentDataModule

    one_thread_unless_told()
    if args.number < 2 or args.step_s <= 0:
        raise ConfigError(
            f"-n {args.number} --step-s {args.step_s}", expected="two or more, and above 0", mend="pass such numbers"
        )
    for output in (args.out, args.occupancy):
        if output is not None:
            check_output(output)
    data = DescentDataModule(args.descents, checkpoint=args.checkpoint, context_table=args.context_table)
    data.setup()
    predictor = DescentPredictor(load_model(args.checkpoint), args.seed)
    try:
        known = data.contexts("validation")
        predictor = predictor.calibrated(data.profiles("validation"), seed=args.seed, context=known)
        print(f"calibrated on the checkpoint's validation flights: noise variance times {predictor.noise_multiple:g}")
    except DataError as error:
        print(f"not calibrated, intervals are likely to be too narrow: {error}")
    flights, context = _chosen(data, args.flight)
    predictions, reasons = [], []
    for i in tqdm(range(len(flights)), desc="flights", delay=2):
        try:
            own = None if context is None else context[i : i + 1]
            predictions.append(
                predictor.predict(flights.subset([i]), args.from_fl, args.number, args.seed, context=own)
            )
        except (DataError, SamplingError) as error:
            reasons.append(str(error))
    if not predictions:
        raise DataError(
            f"no flight of {len(flights)} can be predicted; the first: {reasons[0] if reasons else 'none given'}",
            expected="flights with levels at and above --from-fl",
            mend="choose another --from-fl or other flights",
        )
    intervals = time_intervals(predictions)
    with whole_file(args.out) as temporary:
        intervals.write_parquet(temporary)
    if args.occupancy is not None:
        with whole_file(args.occupancy) as temporary:
            occupancy_table(predictions, args.step_s).write_parquet(temporary)
    print(f"{len(predictions)} flights predicted from FL{args.from_fl:.0f}, {len(reasons)} not")
    for reason in sorted(set(reasons))[:3]:
        print(f"  {reason}")
    compared = coverage(intervals, actual_times(predictions, flights))
    if not compared.is_empty():
        lowest, shares = compared.row(0, named=True), compared["covered"].to_numpy()
        print(
            f"90 % intervals hold {shares.mean():.0%} of the times observed (mean over levels), "
            f"{lowest['covered']:.0%} of {lowest['flights']} at FL{lowest['level_fl']}"
        )
    print(f"wrote {args.out}")


def _chosen(data: "DescentDataModule", names: list[str] | None) -> "tuple[Profiles, Tensor | None]":
    from descentflow.core.errors import ConfigError

    held_out, context = data.profiles("test"), data.contexts("test")
    if not names:
        return held_out, context
    position = {name: i for i, name in enumerate(held_out.flight_ids)}
    unknown = [name for name in names if name not in position]
    if unknown:
        raise ConfigError(
            f"flight {', '.join(unknown)}",
            expected="flights of the file that the checkpoint was not trained or validated on",
            mend=f"choose from {', '.join(held_out.flight_ids[:3])}, ...",
        )
    chosen = [position[name] for name in names]
    return held_out.subset(chosen), None if context is None else context[chosen]
