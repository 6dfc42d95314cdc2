"""Hide effects in flights of the world, diagnose them blind, open the key and score.

python scripts/withheld_effects.py generate FOLDER --sets 400   # injects, seals the key, publishes its hash
python scripts/withheld_effects.py diagnose FOLDER              # resumable; seals every diagnosis
python scripts/withheld_effects.py score FOLDER                 # checks the seals, writes score.json and score.html
python scripts/withheld_effects.py all FOLDER                   # the three in order
"""

import argparse
import secrets
import sys
import time
from pathlib import Path
from typing import Any

from descentflow.core.errors import DescentflowError
from descentflow.studies.blind_diagnosis.blind_page import write_page
from descentflow.studies.blind_diagnosis.blind_plan import Plan, draw_plan
from descentflow.studies.blind_diagnosis.blind_run import diagnose_all, generate
from descentflow.studies.blind_diagnosis.blind_score import score
from descentflow.studies.blind_diagnosis.closing import closing
from descentflow.studies.blind_diagnosis.seal import KEY, MANIFEST, open_key, read_json, write_json

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
        plan = draw_plan(args.sets, seed, n_simulators=args.simulators, more_null=args.more_null)
    generate(args.folder, plan, processes=args.processes, progress=say)
    say(f"key sealed: SHA-256 {read_json(args.folder / MANIFEST)['key_sha256']}")


def do_diagnose(args: argparse.Namespace) -> None:
    until = None if args.minutes is None else time.time() + 60 * args.minutes
    done = diagnose_all(args.folder, processes=args.processes, until=until, parts=args.first, progress=say)
    say(f"{done} diagnoses sealed")


def do_score(args: argparse.Namespace) -> None:
    plan, manifest, diagnoses = open_key(args.folder)
    scored = score(plan, manifest, diagnoses, closings(args.folder, diagnoses))
    write_json(args.folder / "score.json", scored)
    write_page(scored, args.folder / "score.html")
    for goal in scored["goals"]:
        say(f"{goal['goal']}: {goal['reached_text']} ({goal['n']} sets) {VERDICTS[goal['met']]}")


def closings(folder: Path, diagnoses: dict[str, Any]) -> dict[str, Any]:
    """What corrected simulators generate, beside the flights and beside simulators that know the true effect."""
    found = {}
    for name, diagnosis in diagnoses.items():
        job = diagnosis["job"]
        corrected = folder / "reports" / name / "corrected.ckpt"
        true = folder / "simulators" / f"{name.replace('withheld_', 'refit_')}.ckpt"
        if job["corrected"] and corrected.is_file() and true.is_file():
            paths = folder / "sets" / f"{job['set']}.parquet", folder / "simulators" / f"{job['simulator']}.ckpt"
            found[name] = closing(*paths, corrected, true)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("step", choices=["generate", "diagnose", "score", "all"])
    parser.add_argument("folder", type=Path, help="of the study; what is there already is not done again")
    parser.add_argument("--sets", type=int, default=400, help="blind sets (default: 400)")
    parser.add_argument("--more-null", type=int, default=100, help="further sets that hide nothing (default: 100)")
    parser.add_argument("--simulators", type=int, default=40, help="of sets that hide something (default: 40)")
    parser.add_argument("--seed", type=int, help="repeats a study whose key is open (default: not to be guessed)")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--minutes", type=float, help="begin no diagnosis after this time")
    parser.add_argument("--first", nargs="*", default=[], help="jobs whose names begin so come first")
    args = parser.parse_args()
    steps = {"generate": do_generate, "diagnose": do_diagnose, "score": do_score}
    try:
        for step in steps if args.step == "all" else [args.step]:
            steps[step](args)
    except DescentflowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
