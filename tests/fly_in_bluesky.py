"""Fly a scenario or a plugin in BlueSky itself, in a process of its own: python fly_in_bluesky.py FILE OUT.json.

A .scn file is flown as it is; a .py file is loaded as a plugin, with one aircraft for each sample of its .json file.
OUT has, for each callsign, rows of time (s), altitude (ft), latitude, longitude, CAS (kt), twice a second.
"""

import json
import shutil
import sys
import tempfile
from pathlib import Path

import bluesky

KNOT = 0.514444
STEP_S = 0.5
BOTTOM_FT = 15_000.0
BELOW_FT = 13_000.0


def main() -> None:
    source, out = Path(sys.argv[1]), Path(sys.argv[2])
    work = Path(tempfile.mkdtemp(prefix="descentflow-bluesky-"))
    for folder in ("plugins", "scenario"):
        (work / folder).mkdir()
    if source.suffix == ".py":
        shutil.copy(source, work / "plugins")
        shutil.copy(source.with_suffix(".json"), work / "plugins")
        bluesky.init(mode="sim", detached=True, workdir=str(work))
        n, lowest_ft = with_plugin(json.loads(source.with_suffix(".json").read_text())), BELOW_FT
    else:
        text = source.read_text()
        (work / "scenario" / "flights.scn").write_text(f"00:00:00.00>DT {STEP_S}\n{text}")
        bluesky.init(mode="sim", detached=True, workdir=str(work))
        bluesky.stack.stack("IC flights.scn")
        n, lowest_ft = text.count(">CRE "), BOTTOM_FT
    kept: dict[str, list[list[float]]] = {}
    traf = bluesky.traf
    while bluesky.sim.simt < 7200:
        bluesky.sim.step()
        for i, name in enumerate(traf.id):
            state = [bluesky.sim.simt, traf.alt[i] / 0.3048, traf.lat[i], traf.lon[i], traf.cas[i] / KNOT]
            kept.setdefault(name, []).append([float(value) for value in state])
        if len(kept) == n and all(rows[-1][1] <= lowest_ft + 1 for rows in kept.values()):
            break
    shutil.rmtree(work)
    out.write_text(json.dumps(kept))


def with_plugin(data: dict) -> int:
    """One aircraft for each sample, 1,000 ft above it, told to descend below it."""
    from bluesky.core.plugin import Plugin

    loaded, why = Plugin.load("DESCENTFLOW")
    assert loaded, why
    order = bluesky.stack.stack
    order(f"DT {STEP_S}")
    for i, one in enumerate(data["samples"]):
        above = one["altitude_ft"][0] + 1000
        order(f"CRE {one['callsign']} {data['typecode']} {i * 0.5 - 40} 0 90 {above} {one['CAS'][0]}")
    bluesky.sim.step()
    bluesky.sim.step()
    for i, one in enumerate(data["samples"]):
        order(f"DFSAMPLE {one['callsign']} {i}")
        order(f"ALT {one['callsign']} {BELOW_FT}")
    return len(data["samples"])


if __name__ == "__main__":
    main()
