"""`descentflow predict-descent`: the rest of observed descents, from their first part."""

from pathlib import Path
from typing import Annotated, Unpack

from descentflow.cli.options import Where


def run(
    checkpoint: Path,
    descents: Path,
    *,
    from_fl: float,
    out: Path,
    flight: list[str] | None = None,
    number: Annotated[int, "-n"] = 500,
    seed: int = 0,
    context_table: Path | None = None,
    continuations: Path | None = None,
    figure: Path | None = None,
    **where: Unpack[Where],
) -> None:
    """Predict descents from the part at and above a flight level.

    Intervals of the time and the distance to each level below are written, and on request every continuation, in the
    columns of `descentflow sample`. Where the descents go on below that level, the share of flights inside their
    intervals is printed too.

    Args:
        checkpoint: checkpoint that `descentflow fit` wrote (.ckpt)
        descents: prepared descents (descentflow prepare), or rows
        from_fl: last level that counts as observed
        out: table of the intervals (.parquet, .csv)
        flight: flight_id; may be given again (default: every unseen flight)
        number: continuations of each, 50 at least
        seed: the same seed gives the same predictions
        context_table: CSV or Parquet with flight_id and the context, for a conditional model
        continuations: also write every continuation (.parquet, .csv)
        figure (FILE): also draw CAS (kt), vertical rate (ft/min) and time (min) against flight level, predicted and
            flown, of the first four flights: .png or .svg
    """
    from dataclasses import replace

    from descentflow.core.files import check_output, check_separate
    from descentflow.core.progress import stage
    from descentflow.core.tabular import write_table
    from descentflow.core.threads import one_thread_by_default
    from descentflow.generation.prediction.predict import predict
    from descentflow.positions.ground_plan import ground_plan
    from descentflow.reporting.figure_file import check_figure_file, write_figure

    one_thread_by_default()
    plan = ground_plan(**where)
    tables = [output for output in (out, continuations) if output is not None]
    for output in tables:
        check_output(output)
    check_separate(tables, [descents, *([context_table] if context_table else [])])
    if figure is not None:
        check_figure_file(figure)
    with stage("predicting", unit="flights") as predicted:
        ahead = predict(
            checkpoint,
            descents,
            from_fl,
            n=number,
            seed=seed,
            flights=flight,
            context_table=context_table,
            progress=predicted.advance,
            total=predicted.expect,
        )
    ahead = replace(ahead, plan=plan)
    with stage(f"writing {out}"):
        ahead.write(out)
        if continuations is not None:
            write_table(ahead.continuations(), continuations)
    if figure is not None:
        with stage(f"drawing {figure}"):
            write_figure(ahead.figure(), figure)
    print(ahead)
    print(f"wrote {', '.join(map(str, [*tables, figure] if figure else tables))}")
