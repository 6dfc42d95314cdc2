"""`descentflow report`: what cleaning left out of prepared descents, a picture of them, and the air that they met."""

from pathlib import Path


def run(descents: Path, *, air_table: Path | None = None, figure: Path | None = None) -> None:
    """Print what was left out of prepared descents, rule by rule, and write their air or a picture of them.

    Level flight and the pictures of dropped rows need the rows: `descentflow prepare --level-flight`, `--figures`.

    Args:
        descents: prepared descents (descentflow prepare)
        air_table (FILE): table (.csv, .parquet) of the air that the descents met by flight, level and time, with errors
        figure (FILE): airspeed and rate of at most 100 of them, .png or .svg
    """
    from descentflow.air.measured_air import air_table as air_of
    from descentflow.core.files import check_output, check_separate
    from descentflow.core.tabular import write_table
    from descentflow.reporting.figure_file import check_figure_file, write_figure
    from descentflow.surveillance.descents.prepared_descents import read_descents

    outputs = [check_output(path) for path in (air_table, figure) if path]
    check_separate(outputs, [descents])
    if figure:
        check_figure_file(figure)
    prepared = read_descents(descents)
    print(prepared.report)
    if air_table:
        write_table(air_of(prepared.frame), air_table)
    if figure:
        write_figure(prepared.notebook_figure(), figure)
    for path in outputs:
        print(f"wrote {path}")
