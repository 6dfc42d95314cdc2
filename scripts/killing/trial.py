"""A trial: a command is killed at random instants, several times in a row, then run to its end and compared."""

import os
import random
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from killing.content import contents, temporary
from killing.jobs import Job
from killing.warm import Forked, Warm

PATIENCE_S = 600
"""Seconds after which a command that is run again is taken to hang."""
OWN_FILE = re.compile(r'File "([^"]*/descentflow/[^"]+)"')
BEFORE = re.compile(r"/descentflow/(__init__|__main__|cli/\w+|core/\w+)\.py$")
"""Files of the package, and those of them that are loaded before a command begins."""
SAID = "said.txt"
"""Output of the command."""


@dataclass(frozen=True)
class Whole:
    """Result of an undisturbed run of a job.

    Attributes:
        seconds: That it took.
        contents: Digest of each product.
    """

    seconds: float
    contents: dict[str, str]


def undisturbed(job: Job, folder: Path, warm: Warm | None) -> Whole:
    """Run a job to its end, twice: the first time other programs' caches are filled, and both must agree.

    Args:
        job: What is run.
        folder: For what it writes.
        warm: What begins it; a new interpreter if absent.

    Raises:
        RuntimeError: If it fails, writes nothing, or gives something else the second time.
    """
    both = []
    for number in range(2):
        own = folder / str(number)
        own.mkdir(parents=True)
        begun = time.monotonic()
        status, said = _finished(_begin(job.words, own, warm), own)
        seconds = time.monotonic() - begun
        if status != 0:
            raise RuntimeError(f"{' '.join(job.words)}: status {status}\n{said[-2000:]}")
        both.append(Whole(seconds, contents(own, job.products)))
    if not both[0].contents or both[0].contents != both[1].contents:
        changed = [name for name in both[0].contents if both[0].contents[name] != both[1].contents.get(name)]
        raise RuntimeError(f"{' '.join(job.words)}: not the same twice: {changed or 'nothing written'}")
    return both[1]


def trial(
    job: Job, whole: Whole, sent: signal.Signals, folder: Path, rngs: Sequence[random.Random], warm: Warm | None
) -> list[tuple[str, float]]:
    """Kill a job several times in a row, each time where the kill before left it, then let it end.

    What a run left behind is thus found by the next one that is killed, too, and one run to the end serves many kills.
    After a run that had ended before it was killed, the next begins in an empty folder.

    Args:
        job: What is killed.
        whole: Of the job.
        sent: The signal.
        folder: An empty one.
        rngs: Of the instants, one for each kill.
        warm: What begins the command, every time; a new interpreter if absent.

    Returns:
        Of each kill ``same``, ``ended before``, or what is wrong, and the instant in seconds; kills after one that was
        not survived are not done.
    """
    done: list[tuple[str, float]] = []
    for rng in rngs:
        instant = rng.uniform(0.0, whole.seconds)
        wrong, ended = _killed(job, whole, sent, folder, instant, rng, warm)
        done.append((wrong or ("ended before" if ended and not job.spares_parent else "same"), instant))
        if wrong:
            return done
        if ended:
            shutil.rmtree(folder)
            folder.mkdir()
    if any(folder.iterdir()):
        status, said = _finished(_begin(_words(job, folder), folder, warm), folder)
        verdict = f"run again: status {status}: {said[-500:]}" if status != 0 else _compared(job, whole, folder)
        if verdict != "same":
            return [(verdict, instant) for _, instant in done]
    return done


def _killed(
    job: Job,
    whole: Whole,
    sent: signal.Signals,
    folder: Path,
    instant: float,
    rng: random.Random,
    warm: Warm | None,
) -> tuple[str, bool]:
    """Kill a job once: what is wrong then, if anything, and whether it had ended before."""
    process = _begin(_words(job, folder), folder, warm)
    time.sleep(instant)
    ended = process.poll() is not None
    if not ended:
        _send(process, sent, job.spares_parent, rng)
    status, said = _finished(process, folder)
    if _is_traceback(said) and not job.spares_parent:
        return f"traceback: {said[said.index('Traceback') :][:4000]}", ended
    if job.spares_parent and _is_message(said):
        return _half_written(job, whole, folder), False
    if ended or job.spares_parent:
        verdict = f"status {status}: {said[-500:]}" if status != 0 else _compared(job, whole, folder)
        return "" if verdict == "same" else verdict, True
    return _half_written(job, whole, folder), ended


def _words(job: Job, folder: Path) -> tuple[str, ...]:
    return job.again(job, folder) if job.again else job.words


def _is_traceback(said: str) -> bool:
    """Test for a traceback, other than Python's own of a Ctrl-C before the command began."""
    if "Traceback" not in said:
        return False
    own = [place for place in OWN_FILE.findall(said) if not BEFORE.search(place)]
    begun = any(", in main" in line and "<frozen site>" not in line for line in said.splitlines())
    return bool(own) or begun or "KeyboardInterrupt" not in said


def _is_message(said: str) -> bool:
    """Test for an error of the package in a line; libraries that clean up may warn after it."""
    return any("; expected " in line and "; to mend it, " in line for line in said.splitlines())


def _half_written(job: Job, whole: Whole, folder: Path) -> str:
    """Files with a final name that cannot be read, or are not what an undisturbed run leaves."""
    try:
        digests = contents(folder, job.products)
    except Exception as error:
        return f"half written: {error}"
    # Checkpoints of an earlier epoch, and the days that a watch had measured: they are read above.
    if job.words[3:4] in (("fit",), ("watch",)):
        return ""
    changed = sorted(name for name, digest in digests.items() if digest != whole.contents.get(name))
    return f"half written: {', '.join(changed)}" if changed else ""


def _compared(job: Job, whole: Whole, folder: Path) -> str:
    digests = contents(folder, job.products)
    changed = sorted(name for name in whole.contents if digests.get(name) != whole.contents[name])
    if changed:
        return f"other content: {', '.join(changed)}"
    left = temporary(folder)
    return f"left over: {', '.join(left)}" if left else "same"


def _begin(words: tuple[str, ...], folder: Path, warm: Warm | None) -> subprocess.Popen[str] | Forked:
    """Begin a command in a group of its own, so that Ctrl-C reaches it and what it began, as in a terminal."""
    if warm is not None:
        return warm.begin(words, folder, folder / SAID)
    with (folder / SAID).open("w") as said:
        return subprocess.Popen(words, cwd=folder, stdout=said, stderr=said, text=True, process_group=0)


def _finished(process: subprocess.Popen[str] | Forked, folder: Path) -> tuple[int, str]:
    """Exit status, and what was printed."""
    try:
        status = process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        status = process.wait()
    return status, (folder / SAID).read_text(errors="replace")


def _send(process: subprocess.Popen[str] | Forked, sent: signal.Signals, to_a_child: bool, rng: random.Random) -> None:
    """Send a signal: Ctrl-C to all processes of the terminal, another to the command or to one that it began."""
    if sent == signal.SIGINT:
        os.killpg(process.pid, sent)
    elif not to_a_child:
        process.send_signal(sent)
    while to_a_child and process.poll() is None:
        if working := [child for child in _children(process.pid) if not _children(child)]:
            return os.kill(rng.choice(working), sent)
        time.sleep(0.01)


def _children(process: int) -> list[int]:
    """Numbers of the processes that a process began, and of those that these began."""
    own: list[int] = []
    for place in Path(f"/proc/{process}/task").glob("*/children"):
        own += [int(number) for number in place.read_text().split()]
    return own + [number for child in own for number in _children(child)]
