"""`descentflow evaluate`: scores of a checkpoint against the descents of any prepared file."""

from pathlib import Path
from typing import Annotated

from descentflow.cli.options import one_or_several


def run(
    checkpoint: Path,
    *,
    real: Path,
    out: Path,
    simulator: Path | None = None,
    context_table: Path | None = None,
    air: list[str] | None = None,
    number: Annotated[int, "-n"] = 10_000,
    seed: int = 0,
    draw_budget: int | None = None,
    no_figures: bool = False,
) -> None:
    """Sample a checkpoint and score the samples against real descents.

    Time to bottom, CAS and rate above and below transition are scored as Kolmogorov-Smirnov and Wasserstein distance
    and error of the mean, each with the distance between as many real flights and that of nominal BADA. Flights that
    the checkpoint was trained or validated on are left out, by aircraft and time where they come under another
    flight_id.

    Args:
        checkpoint: checkpoint that `descentflow fit` wrote (.ckpt)
        real: prepared descents (descentflow prepare), or rows
        out: folder for scores.csv, rejections.json, level_flight.csv and figures
        simulator: rows or prepared descents of a simulator, whose level flight is compared
        context_table: CSV or Parquet with flight_id and the context, for a conditional model
        air: for a model that was fitted with data.air: where the air of these flights is known from: measured (their
            own reports; default for a model fitted with measured), or a weather field: a NetCDF or GRIB file by
            pressure level, several, or a folder of them
        number: samples
        seed: of sampling and splits
        draw_budget: most draws before giving up (default: 100 for each sample)
        no_figures: draw no figures
    """
    from descentflow.core.files import check_folder
    from descentflow.core.progress import stage
    from descentflow.evaluation.evaluate import N_SPLITS, evaluate
    from descentflow.evaluation.evaluation_report import FILES
    from descentflow.evaluation.metrics.scores import n_comparisons

    check_folder(out, *FILES)
    with stage("reading descents") as shown:
        evaluation = evaluate(
            checkpoint,
            real,
            simulator=simulator,
            n=number,
            seed=seed,
            context_table=context_table,
            air=one_or_several(air),
            draw_budget=draw_budget,
            progress=shown.part("drawing descents", number, "descents"),
            score_progress=shown.part("scoring", n_comparisons(N_SPLITS), "comparisons"),
        )
    with stage("classifying and writing"):
        evaluation.write(out, figures=not no_figures)
    print(evaluation)
    print(f"wrote {out / 'scores.csv'}{'' if no_figures else ' and figures'}")
