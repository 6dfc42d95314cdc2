"""Alternatives to the diagnosis on the same sets: right, wrong or none, and processor seconds."""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.rivals_scoring import Answer, Scored, tally
from benchmarks.rivals_sets import KINDS, RivalSet, read_set, set_folders
from benchmarks.timing import print_row
from descentflow.core.errors import DescentflowError
from descentflow.core.files import whole_file
from descentflow.core.tabular import optional_library

NEEDS = {"descentflow": "descentflow", "dowhy": "dowhy", "pysindy": "pysindy", "mmd": "sbi", "npe": "sbi"}
"""Method -> the library that it needs."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the part's options."""
    parser.add_argument("sets", type=Path, help="folder of folders with real.parquet, simulator.parquet, truth.json")
    parser.add_argument("--only", nargs="+", metavar="SET", help="these sets alone")
    parser.add_argument("--methods", nargs="+", choices=list(NEEDS), default=list(NEEDS), help="default: all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="also write every answer")


def run(args: argparse.Namespace) -> None:
    """Ask every method about every set, and print the counts."""
    scored: dict[str, list[Scored]] = {method: [] for method in args.methods}
    try:
        for method in args.methods:
            optional_library(NEEDS[method], "rivals")
        for folder in set_folders(args.sets, args.only):
            one = read_set(folder)
            for method in args.methods:
                scored[method].append(asked(one, method, args.seed))
                print(said(method, scored[method][-1]), flush=True)
    except DescentflowError as error:
        raise SystemExit(f"error: {error}") from error
    print_tables(scored)
    if args.json:
        with whole_file(args.json) as temporary:
            temporary.write_text(json.dumps({m: [_plain(s) for s in some] for m, some in scored.items()}, indent=1))


def asked(one: RivalSet, method: str, seed: int) -> Scored:
    """One method's answer, with the processor's seconds that it took from the prepared flights on."""
    method_of = _methods()
    start = time.process_time()
    found = method_of[method](one, seed)
    return Scored(one.name, one.kind, one.effects, found, time.process_time() - start)


def _methods() -> dict[str, Callable[[RivalSet, int], Answer]]:
    from benchmarks import rivals_dowhy, rivals_ours, rivals_pysindy, rivals_sbi
    from benchmarks.rivals_measured import measured

    return {
        "descentflow": rivals_ours.answer,
        "dowhy": rivals_dowhy.answer,
        "pysindy": lambda one, seed: rivals_pysindy.answer(measured(one), seed),
        "mmd": lambda one, seed: rivals_sbi.mmd_answer(measured(one), seed),
        "npe": lambda one, seed: rivals_sbi.npe_answer(measured(one), seed),
    }


def said(method: str, one: Scored) -> str:
    """One answer in one line."""
    answer = one.answer
    named = ", ".join("/".join(sorted(group)) for group in answer.named) or "no cause"
    gap = {True: "a gap", False: "no gap", None: "-"}[answer.gap]
    more = ", unknown" if answer.unknown else ""
    verdict = one.cause or "names no causes"
    return f"{one.name:32} {method:12} {verdict:8} {one.seconds:6.1f} s  {gap}: {named}{more}"


def print_tables(scored: dict[str, Sequence[Scored]] | dict[str, list[Scored]]) -> None:
    """Counts by kind of set; `left open`: effects that the first name stands for."""
    for kind in KINDS:
        if not any(one.kind == kind for some in scored.values() for one in some):
            continue
        print(f"\n{kind}")
        print_row(["", "sets", "right", "wrong", "none", "both", "gap said", "left open", "CPU s"])
        for method, some in scored.items():
            of = [one for one in some if one.kind == kind]
            t = tally(of)
            names = any(one.answer.says_causes for one in of)
            causes = [t.right, t.wrong, t.none] if names else ["-", "-", "-"]
            both = t.exact if kind == "double" and names else "-"
            gaps = f"{t.gaps}/{t.says_gaps}"
            open_to = f"{t.left_open:.1f}" if t.left_open else "-"
            print_row([str(x) for x in (method, t.n, *causes, both, gaps, open_to, f"{t.seconds:.1f}")])


def _plain(one: Scored) -> dict[str, object]:
    answer = asdict(one.answer)
    answer["named"] = [sorted(group) for group in one.answer.named]
    return {"set": one.name, "kind": one.kind, "effects": sorted(one.effects), "seconds": one.seconds, **answer}
