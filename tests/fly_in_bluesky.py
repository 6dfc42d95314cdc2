"""Fly a scenario or plugins in BlueSky itself, in a process of its own: python fly_in_bluesky.py PLAN.json OUT.json.

PLAN has ``files``: scenarios, which are flown as they are and together, and plugins, which are loaded; ``step_s``;
``commands``: pairs of a time and a line for BlueSky, in order, after a RESET on its new clock; ``until_s``. OUT has
``flights``, for each callsign rows of time (s), altitude (ft), latitude, longitude, CAS (kt), vertical rate (ft/min),
twice a second; ``left``, which were there at the end; and ``echoed``, what BlueSky said.
"""

import json
import shutil
import sys
import tempfile
from pathlib import Path

import bluesky

KNOT, FPM = 0.514444, 0.3048 / 60


def main() -> None:
    plan, out = json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2])
    work = Path(tempfile.mkdtemp(prefix="descentflow-bluesky-"))
    for folder in ("plugins", "scenario"):
        (work / folder).mkdir()
    files = [Path(name) for name in plan["files"]]
    for file in files:
        shutil.copy(file, work / ("plugins" if file.suffix in (".py", ".json") else "scenario"))
    bluesky.init(mode="sim", detached=True, workdir=str(work))
    echoed: list[str] = []
    for module in (bluesky.stack, bluesky.stack.simstack):
        module.echo = lambda text="", *_, **__: echoed.append(str(text))
    order = bluesky.stack.stack
    for file in files:
        if file.suffix == ".py":
            order(f"PLUGINS LOAD {file.stem.upper()}")
    bluesky.sim.step()
    for number, file in enumerate(file for file in files if file.suffix == ".scn"):
        order(f"{'PCALL' if number else 'IC'} {file.name}")
        bluesky.sim.step()
    kept: dict[str, list[list[float]]] = {}
    waiting = plan["commands"]
    order(f"DT {plan['step_s']}")
    traf = bluesky.traf
    shown = 0.0
    bluesky.sim.op()
    while waiting or bluesky.sim.simt < plan["until_s"]:
        while waiting and waiting[0][0] <= bluesky.sim.simt:
            line = waiting.pop(0)[1]
            order(line)
            if line == "RESET":
                shown = 0.0
                break
        bluesky.sim.step()
        if bluesky.sim.simt >= shown:
            shown += 0.5
            for i, name in enumerate(traf.id):
                state = [bluesky.sim.simt, traf.alt[i] / 0.3048, traf.lat[i], traf.lon[i]]
                state += [traf.cas[i] / KNOT, traf.vs[i] / FPM]
                kept.setdefault(name, []).append([float(value) for value in state])
        if kept and not traf.ntraf and not waiting and not bluesky.stack.get_scendata()[0]:
            break
    shutil.rmtree(work)
    out.write_text(json.dumps({"flights": kept, "left": list(traf.id), "echoed": echoed}))


if __name__ == "__main__":
    main()
