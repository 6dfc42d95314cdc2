"""The command line. Nothing heavy is imported before a command needs it, so `descentflow --help` answers at once."""

import atexit
import gc
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from descentflow.cli import trainer_commands
from descentflow.cli.ending import ended_in_order, print_whatever_comes
from descentflow.core.errors import DescentflowError, DescentflowWarning, check_utf8, nearest
from descentflow.core.progress import clear_line, display
from descentflow.core.version import __version__

COMMANDS = {
    "simulate": "fly aircraft of known truth and write what a radar would report of them",
    "prepare": "clean surveillance rows (Parquet, CSV, aircraft.json) into free descents",
    "report": "what cleaning left out of prepared descents; their air as a table, a picture of them",
    "fit": "train a generator of descents on prepared descents",
    "validate": "log-likelihood of a checkpoint on its validation flights",
    "test": "scores of a checkpoint against held-out flights, with figures",
    "predict": "log-likelihood of each held-out flight (the smaller, the less usual the descent)",
    "info": "what a checkpoint holds: aircraft, levels, flights, context, score",
    "sample": "draw plausible descents from a checkpoint",
    "predict-descent": "the rest of a descent from its first part: time to each level",
    "export": "samples, or the model, in the format of another program",
    "evaluate": "scores of a checkpoint against the descents of any prepared file",
    "diagnose": "where a simulator and real descents differ, and which unmodelled effect causes it",
    "qualify": "whether a simulator descends as real flights do within limits: a record to sign",
    "watch": "whether that difference changes as days of real flights come in",
    "repair": "coefficients of a type that agree with real descents, as TOML, BADA 3 and other files",
}
OUTPUTS = ("out", "report", "figures", "figure", "truth", "continuations", "level_flight", "air_table")
"""Options of commands that name what is written."""
QUIET = "--quiet"
"""Option of every command: no progress on stderr."""

OVERVIEW = f"""usage: descentflow COMMAND [options]

Learn realistic aircraft descents from surveillance data, sample them, and compare them with reality.

commands, in the order of the data's path:
{chr(10).join(f"  {name:<16}{purpose}" for name, purpose in COMMANDS.items())}

`descentflow COMMAND --help` explains one command; --quiet hides its progress; --model FILE.py of any command runs a
file with a density of your own. A first run without data of your own:
  descentflow simulate --typecode A320 --flights 2000 --out rows.parquet
  descentflow prepare rows.parquet --out descents.parquet
  descentflow fit --model Gaussian --data.descents descents.parquet
  descentflow sample runs/Gaussian/version_0/checkpoints/final.ckpt -n 1000 --out samples.parquet
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        arguments: Words after the program's name; those of the process if absent.

    Returns:
        Exit status: 0 if all went well, 2 after an error that the message explains.

    Raises:
        SystemExit: With status 130 after Ctrl-C and 143 after SIGTERM.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if arguments is None:
        # Half a million objects of libraries need no search for cycles at the end of the process: it takes a second.
        atexit.register(gc.freeze)
    print_whatever_comes()
    if not words or words[0] in ("-h", "--help"):
        print(OVERVIEW, end="")
        return 0
    if words[0] == "--version":
        print(f"descentflow {__version__}")
        return 0
    name, rest = words[0], words[1:]
    if name not in COMMANDS:
        meant = nearest(name, COMMANDS)
        known = f"did you mean {meant}? " * bool(meant) + f"there are {', '.join(COMMANDS)}"
        print(f"descentflow: no command {name!r}; {known}", file=sys.stderr)
        return 2
    try:
        with _warnings_in_a_line(name), ended_in_order(name), display(f"descentflow {name}", quiet=QUIET in rest):
            check_utf8(rest)
            return _run(name, rest)
    except DescentflowError as error:
        print(f"descentflow {name}: {error}", file=sys.stderr)
        return 2


@contextmanager
def _warnings_in_a_line(name: str) -> Iterator[None]:
    """Print our own warnings as errors are printed, without file, line and source."""
    usual = warnings.formatwarning

    def shown(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> str:
        clear_line()
        ours = issubclass(category, DescentflowWarning)
        return f"descentflow {name}: warning: {message}\n" if ours else usual(message, category, *place, **more)

    warnings.formatwarning = shown
    try:
        yield
    finally:
        warnings.formatwarning = usual


def _run(name: str, rest: list[str]) -> int:
    if name in trainer_commands.COMMANDS:
        if rest in (["-h"], ["--help"]):
            print(trainer_commands.text(name))
        else:
            trainer_commands.COMMANDS[name]([word for word in rest if word != QUIET])
        return 0
    module = import_module(f"descentflow.cli.{name.replace('-', '_')}_command")
    options_of = import_module("descentflow.cli.options")
    parser = options_of.CommandParser(name, module.run)
    if hasattr(module, "extend"):
        module.extend(parser)
    parser.add_argument(QUIET, action="store_true", help="show no progress; it goes to stderr, after two seconds")
    parser.add_argument("--model", metavar="FILE.py", help="file with a density of your own, which is run")
    options = vars(parser.parse_args(rest))
    if (own := options.pop("model")) is not None:
        options_of.class_in(own)
    del options["quiet"]
    remote = import_module("descentflow.core._remote_files")
    status = remote.with_local_files(lambda given: module.run(**given), options, OUTPUTS)
    for name in OUTPUTS:
        if (url := remote.address(options.get(name))) is not None:
            print(f"sent to {url}")
    return status or 0


if __name__ == "__main__":
    sys.exit(main())
