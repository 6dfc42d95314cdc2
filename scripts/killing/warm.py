"""A process that has loaded the large libraries and forks a command from itself: what is killed is then the work.

``python -m killing.warm`` reads a request of JSON per line and prints the number of the process that it began, then its
exit status. The package is loaded, too, and with it Polars, whose allocator has threads that a fork may lose; its pool
begins with the first query, which is the command's.
"""

import gc
import importlib
import json
import os
import runpy
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from select import select

LOADED = (
    "torch",
    "lightning.pytorch.cli",
    "lightning.pytorch.loggers",
    "torch.utils.tensorboard",
    "matplotlib.pyplot",
    "scipy.stats",
    "scipy.optimize",
    "pyro",
    "normflows",
    "sklearn.ensemble",
    "sklearn.linear_model",
    "sklearn.mixture",
    "sklearn.model_selection",
    "descentflow.cli.lightning_cli",
    "descentflow.diagnosis.diagnose",
    "descentflow.surveillance.prepare",
)
SCRIPTS = Path(__file__).resolve().parents[1]


class Warm:
    """The side that asks.

    Example:
        ``Warm().begin(("python", "-m", "descentflow", "--version"), folder, said)`` gives a :class:`Forked`.
    """

    def __init__(self) -> None:
        self.server = subprocess.Popen(
            (sys.executable, "-m", "killing.warm"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=SCRIPTS,
            process_group=0,  # Ctrl-C at the terminal is the harness's own
        )
        self.read()

    def begin(self, words: tuple[str, ...], folder: Path, said: Path) -> "Forked":
        """Begin a command in a group of processes of its own, which Ctrl-C reaches."""
        assert self.server.stdin is not None
        said.touch()  # what is killed before it has opened it has said nothing
        request = {"words": words[1:], "folder": str(folder), "said": str(said)}
        self.server.stdin.write(json.dumps(request).encode() + b"\n")
        self.server.stdin.flush()
        return Forked(self, self.read())

    def read(self, seconds: float | None = None) -> int:
        """The next number that the server prints.

        Raises:
            subprocess.TimeoutExpired: If it prints none in these seconds.
        """
        assert self.server.stdout is not None
        if seconds is not None and not select([self.server.stdout], [], [], seconds)[0]:
            raise subprocess.TimeoutExpired("killing.warm", seconds)
        number = self.server.stdout.readline()
        if not number:
            raise RuntimeError("the process that begins commands has ended")
        return int(number)


class Forked:
    """A command that was forked, used as :class:`subprocess.Popen` is."""

    def __init__(self, parent: Warm, pid: int) -> None:
        self.parent, self.pid = parent, pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Exit status, or nothing while it runs."""
        try:
            return self.wait(0.0)
        except subprocess.TimeoutExpired:
            return None

    def wait(self, timeout: float | None = None) -> int:
        """Exit status once it has ended."""
        if self.returncode is None:
            self.returncode = self.parent.read(timeout)
        return self.returncode

    def send_signal(self, sent: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, sent)


def serve() -> list[str] | None:
    """Fork what is asked for; gives the words in the process that is to run them, nothing at the end."""
    for name in LOADED:
        importlib.import_module(name)
    gc.freeze()  # what is loaded is not searched for garbage again, neither in a command nor at its end
    _tell(0)
    # Not `for line in sys.stdin`, which reads ahead of the fork.
    while line := os.read(0, 1 << 20):
        request = json.loads(line)
        pid = os.fork()
        if pid == 0:
            os.setpgid(0, 0)
            signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the command begins
            os.chdir(request["folder"])
            said = os.open(request["said"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            nothing = os.open(os.devnull, os.O_RDONLY)
            for number, here in ((nothing, 0), (said, 1), (said, 2)):
                os.dup2(number, here)
            return list(request["words"])
        with suppress(OSError):  # the child has done so itself, and may have ended
            os.setpgid(pid, pid)
        _tell(pid)
        _tell(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
    return None


def _tell(number: int) -> None:
    os.write(1, f"{number}\n".encode())


def run(words: list[str]) -> None:
    """Run the words after the interpreter's name as it would: ``-m descentflow ...``, ``-c CODE``, ``SCRIPT ...``."""
    sys.path[0] = os.getcwd()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if words[0] == "-c":
        sys.argv = ["-c"]
        exec(compile(words[1], "<string>", "exec"), {"__name__": "__main__"})
    elif words[0] == "-m":
        sys.argv = words[1:]
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        sys.argv, sys.path[0] = words, str(Path(words[0]).parent)
        runpy.run_path(words[0], run_name="__main__")


if __name__ == "__main__" and (asked := serve()) is not None:
    run(asked)
