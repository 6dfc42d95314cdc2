"""Hide effects in flights, diagnose them blind by five forms of simulator, open the key and score.

python scripts/withheld_effects.py generate FOLDER --own 300 --foreign 200  # seals the key, flies, publishes the hash
python scripts/withheld_effects.py diagnose FOLDER   # resumable; seals every diagnosis
python scripts/withheld_effects.py score FOLDER [FOLDER ...]  # checks the seals, writes score.json and score.md
python scripts/withheld_effects.py all FOLDER        # the three in order

Foreign sets are flown by JSBSim (the extra jsbsim). `--forms flights bare` compares simulators in the same weather and
in none, without checkpoints, which cost most. Several folders are studies of keys of their own, scored as one.
Every step prints how long each set takes and what is left.
"""

import argparse
import secrets
import sys
import time
from pathlib import Path
from typing import Any

from descentflow.core.errors import ConfigError, DescentflowError
from descentflow.core.files import write_whole
from studies.blind_diagnosis.blind_draw import draw_plan
from studies.blind_diagnosis.blind_plan import FORMS, Plan
from studies.blind_diagnosis.blind_run import diagnose_all, generate, how_long, measure_closures
from studies.blind_diagnosis.outcome import Outcome, outcomes
from studies.blind_diagnosis.seal import KEY, MANIFEST, open_key, read_json, write_json
from studies.blind_diagnosis.study_score import score, table


def say(line: str) -> None:
    print(line, flush=True)


def do_generate(args: argparse.Namespace) -> None:
    (folder,) = args.folders
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / KEY).is_file():
        plan = Plan.from_dict(read_json(folder / KEY))
        say(f"a study of {len(plan.sets)} sets is begun here: going on with it")
    else:
        # A seed that anyone could guess would be no seal; it is in the key and repeats the study once that is open.
        seed = secrets.randbits(32) if args.seed is None else args.seed
        plan = draw_plan(args.own, seed, n_foreign=args.foreign, withheld=not args.no_withheld)
    generate(folder, plan, forms=args.forms, until=until(args), processes=args.processes, progress=say)
    say(f"key sealed: SHA-256 {read_json(folder / MANIFEST)['key_sha256']}")


def until(args: argparse.Namespace) -> float | None:
    """Time after which nothing more is begun."""
    return None if args.minutes is None else time.time() + 60 * args.minutes


def do_diagnose(args: argparse.Namespace) -> None:
    (folder,) = args.folders
    done = diagnose_all(folder, processes=args.processes, until=until(args), parts=args.first, progress=say)
    say(f"{done} diagnoses sealed\n{how_long(folder)}")


def do_score(args: argparse.Namespace) -> None:
    judged: list[Outcome] = []
    closures: dict[str, Any] = {}
    keys = [read_json(folder / MANIFEST)["key_sha256"] for folder in args.folders]
    if len(set(keys)) < len(keys):
        raise ConfigError("one key twice", expected="studies of different keys", mend="name each folder once")
    for key, folder in zip(keys, args.folders, strict=True):
        plan, manifest, diagnoses = open_key(folder)
        prefix = "" if len(keys) == 1 else f"{key[:8]}/"
        several = {"processes": args.processes, "prefix": prefix, "progress": say}
        closures |= measure_closures(folder, plan, manifest, **several)
        judged += outcomes(plan, manifest, diagnoses, prefix=prefix)
    scored = score(judged, closures) | {"keys": keys}
    write_json(args.folders[0] / "score.json", scored)
    write_whole(args.folders[0] / "score.md", table(scored) + "\n")
    say(table(scored))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("step", choices=["generate", "diagnose", "score", "all"])
    parser.add_argument("folders", type=Path, nargs="+", help="of a study; what is there already is not done again")
    parser.add_argument("--own", type=int, default=300, help="blind sets of our own world (default: 300)")
    parser.add_argument("--foreign", type=int, default=200, help="blind sets of JSBSim's aircraft (default: 200)")
    parser.add_argument("--no-withheld", action="store_true", help="blind sets alone, no effect withheld by name")
    parser.add_argument("--seed", type=int, help="repeats a study whose key is open (default: not to be guessed)")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--minutes", type=float, help="begin no flights and no diagnosis after this time")
    parser.add_argument("--forms", nargs="*", choices=FORMS, default=FORMS, help="of the simulators (default: all)")
    parser.add_argument("--first", nargs="*", default=[], help="jobs whose names begin so come first")
    args = parser.parse_args()
    steps = {"generate": do_generate, "diagnose": do_diagnose, "score": do_score}
    if args.step != "score" and len(args.folders) > 1:
        parser.error(f"{args.step} takes one folder")
    try:
        for step in steps if args.step == "all" else [args.step]:
            steps[step](args)
    except DescentflowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
