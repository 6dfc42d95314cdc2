"""Hide effects in flights of the world, diagnose them blind, open the key and score.

python scripts/withheld_effects.py generate FOLDER --own 520 --foreign 200  # seals the key, flies, publishes the hash
python scripts/withheld_effects.py diagnose FOLDER   # resumable; seals every diagnosis
python scripts/withheld_effects.py score FOLDER      # checks the seals, writes score.json and score.html
python scripts/withheld_effects.py all FOLDER        # the three in order
python scripts/withheld_effects.py publish FOLDER --sets OUT --most 60  # of an open study, for benchmark.py rivals
python scripts/withheld_effects.py score FOLDER --beside OTHER/evidence.json.gz  # two parts of other keys as one study

Foreign sets are flown by JSBSim (the extra jsbsim). Every step prints how long each set takes and what is left.
"""

import argparse
import secrets
import sys
import time
from pathlib import Path
from typing import Any

from descentflow.core.errors import DescentflowError
from studies.blind_diagnosis.blind_draw import draw_plan
from studies.blind_diagnosis.blind_flights import reference_type
from studies.blind_diagnosis.blind_page import write_page
from studies.blind_diagnosis.blind_plan import Plan
from studies.blind_diagnosis.blind_run import diagnose_all, fly_true, generate, how_long
from studies.blind_diagnosis.blind_score import score
from studies.blind_diagnosis.closing import closing
from studies.blind_diagnosis.known_sets import write_known_sets
from studies.blind_diagnosis.seal import KEY, MANIFEST, open_key, read_json, write_json
from studies.blind_diagnosis.study_evidence import Evidence, pooled, read_evidence, write_evidence

EVIDENCE = "evidence.json.gz"
"""File with the basis of a score; other parts of a study can be scored beside this one."""
VERDICTS = {True: "met", False: "MISSED", None: "not judged"}


def say(line: str) -> None:
    print(line, flush=True)


def do_generate(args: argparse.Namespace) -> None:
    args.folder.mkdir(parents=True, exist_ok=True)
    if (args.folder / KEY).is_file():
        plan = Plan.from_dict(read_json(args.folder / KEY))
        say(f"a study of {len(plan.sets)} sets is begun here: going on with it")
    else:
        # A seed that anyone could guess would be no seal; it is in the key and repeats the study once that is open.
        seed = secrets.randbits(32) if args.seed is None else args.seed
        plan = draw_plan(args.own, seed, n_foreign=args.foreign, extra=not args.no_withheld)
    generate(args.folder, plan, processes=args.processes, progress=say)
    say(f"key sealed: SHA-256 {read_json(args.folder / MANIFEST)['key_sha256']}")


def do_diagnose(args: argparse.Namespace) -> None:
    until = None if args.minutes is None else time.time() + 60 * args.minutes
    done = diagnose_all(args.folder, processes=args.processes, until=until, parts=args.first, progress=say)
    say(f"{done} diagnoses sealed\n{how_long(args.folder)}")


def do_score(args: argparse.Namespace) -> None:
    plan, manifest, diagnoses = open_key(args.folder)
    fly_true(args.folder, plan, processes=args.processes, progress=say)
    mine = Evidence.of(plan, manifest, diagnoses, closings(args.folder, plan))
    write_evidence(mine, args.folder / EVIDENCE)
    whole = pooled([mine, *(read_evidence(path) for path in args.beside)])
    scored = score(whole.plan, whole.manifest, whole.diagnoses, whole.closings)
    write_json(args.folder / "score.json", scored)
    write_page(scored, args.folder / "score.html")
    for goal in scored["goals"]:
        missed = f": {', '.join(goal['misses'])}" if goal["met"] is False else ""
        say(f"{goal['goal']}: {goal['reached_text']} ({goal['n']} sets) {VERDICTS[goal['met']]}{missed}")


def do_publish(args: argparse.Namespace) -> None:
    out = args.sets or args.folder / "known_sets"
    say(f"{write_known_sets(args.folder, out, args.most, say)} sets in {out}")


def closings(folder: Path, plan: Plan) -> dict[str, Any]:
    """Distances of corrected flights from the real ones, beside those of simulators that know the true effect."""
    found = {}
    for one in plan.sets:
        corrected = folder / "reports" / f"{one.name}_flights" / "corrected.parquet"
        if one.true is not None and corrected.is_file():
            held, true = (folder / "simulators" / f"{name}.parquet" for name in (one.simulator, one.true))
            rows = folder / "sets" / f"{one.name}.parquet"
            found[one.name] = closing(rows, held, corrected, true, reference_type(one.world, one.model))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("step", choices=["generate", "diagnose", "score", "all", "publish"])
    parser.add_argument("folder", type=Path, help="of the study; what is there already is not done again")
    parser.add_argument("--own", type=int, default=520, help="blind sets of our own world (default: 520)")
    parser.add_argument("--foreign", type=int, default=200, help="blind sets of JSBSim's aircraft (default: 200)")
    parser.add_argument("--no-withheld", action="store_true", help="blind sets alone, no effect withheld by name")
    parser.add_argument("--seed", type=int, help="repeats a study whose key is open (default: not to be guessed)")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--minutes", type=float, help="begin no diagnosis after this time")
    parser.add_argument(
        "--beside", nargs="*", default=[], type=Path, help=f"{EVIDENCE} of other parts, to score as one"
    )
    parser.add_argument("--first", nargs="*", default=[], help="jobs whose names begin so come first")
    parser.add_argument("--sets", type=Path, help="of publish: folder for the sets (default: known_sets in FOLDER)")
    parser.add_argument("--most", type=int, default=60, help="of publish: sets at the most, drawn at random")
    args = parser.parse_args()
    steps = {"generate": do_generate, "diagnose": do_diagnose, "score": do_score}
    try:
        if args.step == "publish":
            do_publish(args)
            return 0
        for step in steps if args.step == "all" else [args.step]:
            steps[step](args)
    except DescentflowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
