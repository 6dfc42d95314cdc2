"""Give every command damaged inputs, and count what it makes of them.

python scripts/fuzz.py FOLDER --cases 100000             # resumable: what is in FOLDER/outcomes.jsonl is not run again
python scripts/fuzz.py FOLDER --cases 100000 --minutes 60
python scripts/fuzz.py FOLDER --cases 100000 --again     # after a mend: run what was a defect once more
python scripts/fuzz.py FOLDER --cases 1000 --kind weather  # one kind of input alone
python scripts/fuzz.py FOLDER --show 4711                # write case 4711 into FOLDER/case-4711 and run it
python scripts/fuzz.py FOLDER --arguments                # every wrong value of every argument of the public calls

Each case is known by its number and the seed. It ends as accepted (every row kept or counted), refused (one message:
what was got, what was expected, how to mend it; no file left), or it is a defect: a traceback, a signal, over 30 s,
over 4 GB, rows lost in silence, a wrong file left. Exit status 1 if there is a defect.
"""

import argparse
import collections
import json
import os
import sys
import time
from pathlib import Path

FINE = ("accepted", "refused")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--minutes", type=float, help="begin no case after this time")
    parser.add_argument("--again", action="store_true", help="run once more what was a defect")
    parser.add_argument(
        "--kind", help="of input, see KINDS of fuzzing/cases.py; all of them, each by its share, if absent"
    )
    parser.add_argument("--arguments", action="store_true", help="all public calls with one wrong argument")
    parser.add_argument("--show", type=int, metavar="CASE", help="write and run one case")
    args = parser.parse_args()
    # Workers are many: one thread each. Read when torch is loaded.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    from fuzzing.cases import ARGUMENTS
    from fuzzing.good_files import make
    from fuzzing.wrong_arguments import every_pair

    args.folder = args.folder.resolve()
    good = args.folder / "good"
    make(good)
    if args.arguments:
        args.seed, args.cases = ARGUMENTS, len(every_pair(good))
    if args.show is not None:
        return show(args.folder, good, args.seed, args.show, args.kind)
    outcomes = run(args.folder, good, args)
    return report(outcomes)


def run(folder: Path, good: Path, args: argparse.Namespace) -> list[dict]:
    """Outcomes of all cases, those of earlier calls with the same seed among them."""
    from fuzzing import workers

    path = folder / f"outcomes-{args.seed}{f'-{args.kind}' if args.kind else ''}.jsonl"
    known = [json.loads(line) for line in path.read_text().splitlines()] if path.is_file() else []
    if args.again:
        known = [before for before in known if before["verdict"] in FINE]
        whole = path.with_suffix(".part")
        whole.write_text("".join(json.dumps(before) + "\n" for before in known))
        whole.replace(path)
    done = {before["case"] for before in known}
    left = [number for number in range(args.cases) if number not in done]
    until = None if args.minutes is None else time.time() + 60 * args.minutes
    with path.open("a") as file:
        for outcome in workers.run(left, args.seed, good, args.processes, until, args.kind):
            file.write(json.dumps(outcome) + "\n")
            file.flush()
            known.append(outcome)
            if outcome["verdict"] not in FINE:
                print(
                    f"case {outcome['case']}: {outcome['kind']}: {outcome['verdict']}: {last_line(outcome['words'])}",
                    flush=True,
                )
    return known


def report(outcomes: list[dict]) -> int:
    """Print how many cases of each kind ended how."""
    counts = collections.Counter((outcome["kind"].split()[0], outcome["verdict"]) for outcome in outcomes)
    verdicts = sorted({verdict for _, verdict in counts}, key=lambda name: (name not in FINE, name))
    print("".join(f"{name:>24}" for name in ("", *verdicts)))
    for kind in sorted({kind for kind, _ in counts}):
        print(f"{kind:>24}" + "".join(f"{counts[kind, verdict]:>24,}" for verdict in verdicts))
    defects = sum(number for (_, verdict), number in counts.items() if verdict not in FINE)
    print(f"{len(outcomes):,} cases, {defects:,} defects")
    return 1 if defects else 0


def show(folder: Path, good: Path, seed: int | str, number: int, kind: str | None) -> int:
    """Write one case's files where they can be looked at, and run it."""
    from fuzzing.cases import build
    from fuzzing.judge import judged

    place = folder / f"case-{number}"
    place.mkdir(exist_ok=True)
    case = build(number, seed, good, place, kind)
    print(f"{case.kind}: descentflow {' '.join(word[:200] for word in case.words)}")
    verdict = judged(case, place)
    print(f"{verdict.verdict}\n{verdict.words}")
    return 0 if verdict.verdict in FINE else 1


def last_line(words: str) -> str:
    lines = words.strip().splitlines()
    return lines[-1][:200] if lines else ""


if __name__ == "__main__":
    sys.exit(main())
