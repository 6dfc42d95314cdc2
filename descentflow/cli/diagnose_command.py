"""`descentflow diagnose`: where a simulator and real descents differ, which effect causes it, how far it shrinks."""

import sys
from pathlib import Path
from shlex import quote
from typing import Unpack

from descentflow.cli.options import Sides, of_sides, one_or_several


def run(
    *,
    real: list[Path],
    out: Path,
    simulator: list[Path] | None = None,
    air: list[str] | None = None,
    channels: str | None = None,
    catalogue: Path | None = None,
    previous: Path | None = None,
    seed: int = 0,
    **sides: Unpack[Sides],
) -> None:
    """Compare a simulator with real descents: where they differ, and which unmodelled effect causes it.

    The report has how far the gap shrinks once the effect is added, too. The simulator is a checkpoint, or flights of
    any simulator. Writes gap.json, gap.html and, with a cause, the corrected simulator (corrected.ckpt) or its flights
    (corrected.parquet).

    Args:
        real: rows, or prepared descents (descentflow prepare)
        out: folder for the report; not one of other flights or another simulator
        simulator: checkpoint that `descentflow fit` wrote; or flights of any simulator, as rows or prepared descents:
            files, folders, in every format that `descentflow prepare` reads; distinguished by their content
        air: for a model that was fitted with data.air: where the air of these flights is known from: measured (their
            own reports; default for a model fitted with measured), or a weather field: a NetCDF or GRIB file by
            pressure level, several, or a folder of them
        channels: use these alone, for instance IAS,Mach,TAS,groundspeed (default: all)
        catalogue (FILE.py): effects of your own that may be named as well as the package's: classes or instances of
            descentflow.effects.Effect in this Python file, which is run
        previous: gap.json of the diagnosis before the simulator was changed: predicted against achieved closure
        seed: the same seed gives the same answer
    """
    from descentflow.core.progress import stage
    from descentflow.diagnosis.diagnose import diagnose
    from descentflow.diagnosis.report.page import next_command, summary

    if catalogue is not None:
        print(f"descentflow diagnose: runs {catalogue} for the effects that it defines", file=sys.stderr)
    with stage("opening") as shown:
        report = diagnose(
            one_or_several(real),
            one_or_several(simulator),
            air=one_or_several(air),
            channels=[name.strip() for name in channels.split(",")] if channels else None,
            catalogue=catalogue,
            previous=previous,
            seed=seed,
            out=out,
            progress=shown.say,
            **of_sides(sides),
        )
    typed = [" ".join(map(quote, map(str, paths or []))) for paths in (real, simulator)]
    against = f"--simulator {typed[1]}" if simulator else f"--typecode {sides.get('typecode')}"
    print(summary(report, next_command(report, out, typed[0], against)))
    print(f"wrote {out / 'gap.json'} and {out / 'gap.html'}")
