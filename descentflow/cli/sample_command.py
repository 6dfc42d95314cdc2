"""`descentflow sample`: draw plausible descents from a checkpoint."""

from pathlib import Path
from typing import Annotated, Unpack

from descentflow.cli.options import Where, context_of, pairs


def run(
    checkpoint: Path,
    *,
    out: Path,
    number: Annotated[int, "-n"] = 10_000,
    seed: int = 0,
    figure: Path | None = None,
    given: list[str] | None = None,
    given_table: Path | None = None,
    air: list[str] | None = None,
    draw_budget: int | None = None,
    **where: Unpack[Where],
) -> None:
    """Draw plausible descents from a fitted model.

    They are written as one long table: a row per sample and flight level, with time since entry, altitude, CAS, Mach,
    TAS, vertical rate, drag, distances and groundspeed. A model that was fitted with data.context needs a context, by
    --given or --given-table; the table then holds it too.

    Args:
        checkpoint: checkpoint that `descentflow fit` wrote (.ckpt)
        out: output: .parquet, .csv or .nc (NetCDF)
        number: descents wanted
        seed: the same seed gives the same descents
        figure (FILE): also draw CAS (kt), vertical rate (ft/min) and time (min) against flight level: .png or .svg
        given (NAME=VALUE): context of all descents, for a model that was fitted with data.context: deviation_k=10
            operator=FST
        given_table: CSV or Parquet with the columns of the context; sample i is of row i, beginning again after the
            last
        air: air of all descents: deviation_k=10 (K from the standard atmosphere), tailwind_growth=1.5 (kt more
            tailwind for each 1,000 ft), or both; a .csv or .parquet table with level_fl, deviation_k and tailwind
            (kt); a weather field on pressure levels (NetCDF or GRIB file, or a folder of them), met along the path of
            --end and --track, or --route, at --time; standard; or training, drawn from the training flights' own
            (default for a model fitted with data.air=measured or a weather field; standard for others)
        draw_budget: most draws before giving up (default: 100 for each descent wanted)
    """
    from descentflow.core.files import check_output, check_separate
    from descentflow.core.progress import stage
    from descentflow.generation.sample import sample
    from descentflow.positions.ground_plan import ground_plan
    from descentflow.reporting.figure_file import check_figure_file, write_figure

    check_output(out)
    tables = [*([given_table] if given_table else []), *map(Path, air or [])]
    check_separate([out], tables)
    if figure is not None:
        check_figure_file(figure)
    with stage("drawing descents", number, "descents") as drawn:
        samples = sample(
            checkpoint,
            number,
            seed=seed,
            context=context_of(given, given_table),
            air=_air(air),
            plan=ground_plan(**where),
            draw_budget=draw_budget,
            progress=drawn.advance,
        )
    with stage(f"writing {out}"):
        samples.write(out)
    if figure is not None:
        with stage(f"drawing {figure}"):
            write_figure(samples.figure(title=f"{checkpoint.name}: {len(samples):,} samples"), figure)
    print(samples.report)
    print(f"wrote {out}{f' and {figure}' if figure else ''}")


def _air(words: list[str] | None) -> dict[str, str] | str | None:
    """A name or a file, or values by name."""
    return words[0] if words and len(words) == 1 and "=" not in words[0] else pairs("--air", words) if words else None
