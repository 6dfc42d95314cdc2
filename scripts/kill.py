"""Kill commands at random instants, run them again, and hold what they wrote against undisturbed runs.

python scripts/kill.py FOLDER --times 100      # of each command and signal; resumable: what is done is not repeated
python scripts/kill.py FOLDER --times 5 --commands "sample;fit flow, resumed" --signals KILL
python scripts/kill.py FOLDER --minutes 60

A command is killed five times in a row, each time where the kill before left it, and then runs to its end. Four of five
such rows begin in a process that has loaded torch and Lightning already: the instants fall on the work. In the fifth,
which begins a new interpreter, they fall on imports too.

After a kill nothing may lie under a final name that is not whole; after the same command again (`fit` also resumed from
its last checkpoint) the content must be that of an undisturbed run to the bit, and no temporary file may be left. Of
"prepare, a Dask worker", "study, a process" and "study, a Dask worker" a process that the command began is killed: it
must end well by itself, or with an error in a line after which the same command gives the same. Exit status 1 if
something else was found.
"""

import argparse
import collections
import json
import os
import random
import shutil
import signal
import sys
import time
from pathlib import Path

FINE = ("same", "ended before")
IN_A_ROW = 5
"""Kills of a command before it is let run to its end."""
ANEW = 5
"""Of so many rows, one begins new interpreters."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--times", type=int, default=5, help="kills of each command by each signal (default: 5)")
    parser.add_argument("--commands", help="some of them, with semicolons between them (default: all)")
    parser.add_argument("--signals", default="KILL,TERM,INT", help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="of the instants")
    parser.add_argument("--minutes", type=float, help="begin no trial after this time")
    args = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # A shell that begins this in the background has Ctrl-C ignored, which all that is begun here would inherit.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    args.folder = args.folder.resolve()
    path = args.folder / f"kills-{args.seed}.jsonl"
    args.folder.mkdir(parents=True, exist_ok=True)
    run(args, path)
    return report([json.loads(line) for line in path.read_text().splitlines()])


def run(args: argparse.Namespace, path: Path) -> None:
    """Do the trials that are not in the file yet, and add their outcomes to it."""
    from killing.inputs import make
    from killing.jobs import jobs
    from killing.trial import Whole, trial, undisturbed
    from killing.warm import Warm

    make(args.folder / "inputs")
    path.touch()
    done = {(row["command"], row["signal"], row["number"]) for row in map(json.loads, path.read_text().splitlines())}
    every = jobs(args.folder / "inputs")
    chosen = args.commands.split(";") if args.commands else list(every)
    until = None if args.minutes is None else time.time() + 60 * args.minutes
    whole: dict[tuple[str, bool], Whole] = {}
    loaded = Warm()
    for begin in range(0, args.times, IN_A_ROW):  # all commands, then all once more: an hour says something of each
        for name in chosen:
            for sent in args.signals.split(",") if not every[name].spares_parent else ["KILL"]:
                row = range(begin, min(begin + IN_A_ROW, args.times))
                numbers = [number for number in row if (name, sent, number) not in done]
                if not numbers or (until is not None and time.time() > until):
                    continue
                place = args.folder / "work"
                anew = begin // IN_A_ROW % ANEW == ANEW - 1 or every[name].always_anew
                warm = None if anew else loaded
                if (name, anew) not in whole:
                    shutil.rmtree(place, ignore_errors=True)
                    whole[name, anew] = undisturbed(every[name], place, warm)
                    if (name, not anew) in whole and whole[name, anew].contents != whole[name, not anew].contents:
                        raise RuntimeError(f"{name}: a new interpreter writes something else")
                shutil.rmtree(place, ignore_errors=True)
                place.mkdir()
                rngs = [random.Random(f"{args.seed}-{name}-{sent}-{number}") for number in numbers]
                verdicts = trial(every[name], whole[name, anew], signal.Signals[f"SIG{sent}"], place, rngs, warm)
                for number, (verdict, instant) in zip(numbers, verdicts, strict=False):
                    told = {"command": name, "signal": sent, "number": number, "after_s": round(instant, 3)}
                    with path.open("a") as file:
                        file.write(json.dumps({**told, "anew": anew, "verdict": verdict}) + "\n")
                if any(verdict not in FINE for verdict, _ in verdicts):
                    print(f"{name}, SIG{sent}, {begin}: {verdicts}", flush=True)
                    kept = args.folder / f"{name.replace(', ', '-').replace(' ', '-')}-{sent}-{begin}"
                    shutil.rmtree(kept, ignore_errors=True)
                    shutil.copytree(place, kept)
    shutil.rmtree(args.folder / "work", ignore_errors=True)


def report(outcomes: list[dict]) -> int:
    """Print how many kills of each command ended how."""
    counts = collections.Counter((outcome["command"], outcome["verdict"].partition(":")[0]) for outcome in outcomes)
    verdicts = sorted({verdict for _, verdict in counts}, key=lambda name: (name not in FINE, name))
    print(f"{'':<26}" + "".join(f"{name:>16}" for name in verdicts))
    for command in dict.fromkeys(outcome["command"] for outcome in outcomes):
        print(f"{command:<26}" + "".join(f"{counts[command, verdict]:>16}" for verdict in verdicts))
    wrong = sum(outcome["verdict"] not in FINE for outcome in outcomes)
    print(f"{len(outcomes)} kills, {wrong} that were not survived")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
