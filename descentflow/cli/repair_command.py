"""`descentflow repair`: coefficients of a type that agree with real flights."""

from pathlib import Path

from descentflow.cli.options import one_or_several, pairs


def run(
    flights: list[Path],
    *,
    aircraft: str,
    out: Path,
    bada_dir: Path | None = None,
    column: list[str] | None = None,
) -> None:
    """Estimate CD0, CD2, idle thrust and descent speeds of a type by real flights, at its reference mass.

    Twenty flights are enough to begin with; flights of sister types in the same files share a prior. Writes OUT with
    each number's source and 90 % interval, and in its folder the type's OPF and APF, OpenAP's polar, bluebird-dt's
    tables and a page: errors before and after on aircraft that were not used. Of BADA 4, OUT is the page, and the
    model's XML file is there too.

    Args:
        flights: rows, or prepared descents (descentflow prepare)
        aircraft: type designator, for instance A320
        out: output: coefficients, .toml, or of BADA 4 the page, .html; not in the folder of the BADA files
        bada_dir: folder of BADA 3 or 4 with the type to repair (default: open aircraft)
        column (NAME=COLUMN): column of the rows' tables for a name of the rows, as in `descentflow prepare`; may be
            given again
    """
    from descentflow.core.progress import stage
    from descentflow.repairs.repair import repair
    from descentflow.repairs.repaired_files import paths_of

    with stage("opening") as shown:
        repaired = repair(
            one_or_several(flights),
            aircraft=aircraft.upper(),
            bada_dir=bada_dir,
            out=out,
            columns=pairs("--column", column or []),
            progress=shown.say,
        )
    print(repaired)
    print(f"wrote {', '.join(str(path) for path in paths_of(out, repaired.after.typecode, repaired.own).values())}")
