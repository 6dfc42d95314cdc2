"""Workers that run cases one after the other; one that dies or hangs is a defect of its case, and is replaced."""

import multiprocessing
import resource
import shutil
import signal
import tempfile
import time
from collections.abc import Iterable, Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

GRACE_S = 15
"""Seconds after the case's own limit at which a worker is killed: what runs in a library does not hear the alarm."""
MOST_BYTES = 4 * 10**9
ADDRESS_SPACE = 16 * 10**9
"""Bytes that a worker may map at all; libraries map far more than they use."""
CASES_EACH = 300
"""Cases after which a worker is replaced, so that what one leaves behind is not another's."""


def run(
    numbers: Iterable[int], seed: int | str, good: Path, processes: int, until: float | None, kind: str | None
) -> Iterator[dict[str, Any]]:
    """Outcomes of cases as they come in.

    Args:
        numbers: Of the cases.
        seed: Of the run.
        good: Folder of whole files.
        processes: Workers at once.
        until: Time after which no case is begun.
        kind: Of input; all if absent.
    """
    waiting = iter(numbers)
    workers = [_Worker(seed, good, kind) for _ in range(processes)]
    try:
        for worker in workers:
            worker.give(waiting, until)
        while busy := [worker for worker in workers if worker.number is not None]:
            ready = wait([worker.pipe for worker in busy], timeout=1.0)
            for worker in busy:
                if worker.pipe in ready or worker.is_late():
                    yield worker.outcome()
                    worker.give(waiting, until)
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A process, and the case that it has."""

    def __init__(self, seed: int | str, good: Path, kind: str | None) -> None:
        self.known = seed, good, kind
        self.number: int | None = None
        self.begin()

    def begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, *self.known), daemon=True)
        self.process.start()
        theirs.close()
        self.left = CASES_EACH
        self.pipe.recv()  # it has imported what it needs

    def give(self, waiting: Iterator[int], until: float | None) -> None:
        self.number = next(waiting, None) if until is None or time.time() < until else None
        if self.number is None:
            return
        if self.left == 0:
            self.end()
            self.begin()
        self.left -= 1
        self.begun = time.monotonic()
        self.pipe.send(self.number)

    def is_late(self) -> bool:
        from fuzzing.judge import WAITING_S

        return time.monotonic() - self.begun > WAITING_S + GRACE_S

    def outcome(self) -> dict[str, Any]:
        """Outcome of the case, whatever became of the process."""
        case = {"case": self.number, "seconds": round(time.monotonic() - self.begun, 2)}
        try:
            if self.pipe.poll():
                return {**case, **self.pipe.recv()}
            ending = {"kind": "?", "verdict": "hung", "words": "killed"}
        except EOFError:
            self.process.join(5)
            code = self.process.exitcode or 0
            name = signal.Signals(-code).name if code < 0 else f"exit {code}"
            ending = {"kind": "?", "verdict": "ended by a signal", "words": name}
        self.end()
        self.begin()
        return {**case, **ending}

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def _work(pipe: Connection, seed: int | str, good: Path, kind: str | None) -> None:
    """Run the cases whose numbers come through the pipe."""
    from fuzzing.cases import build
    from fuzzing.judge import judged

    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    pipe.send("ready")
    while True:
        try:
            number = pipe.recv()
        except EOFError:
            return
        folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
        try:
            case = build(number, seed, good, folder, kind)
            judgement = judged(case, folder)
            verdict, words = judgement.verdict, judgement.words
            used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
            if used > MOST_BYTES:
                verdict, words = "over the memory", f"{used / 1e9:.1f} GB"
            pipe.send({"kind": case.kind, "command": case.words[0], "verdict": verdict, "words": words})
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        if used > MOST_BYTES:
            return  # the most that a process has used never goes down again
