"""Messages name only options that there are."""

import ast
import inspect
import re
from importlib import import_module
from pathlib import Path

import descentflow
from descentflow.cli import trainer_commands
from descentflow.cli.entry import COMMANDS
from descentflow.cli.options import CommandParser
from descentflow.training.callbacks.score_callback import ScoreCallback
from descentflow.training.datamodule import DescentDataModule

OPTION = re.compile(r"(?<![\w-])--[a-z][\w.-]*[a-z]")
MESSAGES = re.compile("MEND|REASON|EXPECTED")
SOURCES = [path for ending in ("py", "toml") for path in sorted(Path(descentflow.__file__).parent.rglob(f"*.{ending}"))]


def options() -> set[str]:
    """Every option of every command, as the parsers have them."""
    own = {"data": DescentDataModule, "scores": ScoreCallback}
    known = {f"--{section}.{name}" for section, kind in own.items() for name in inspect.signature(kind).parameters}
    known |= {"--config", "--model", "--data", "--ckpt_path", "--weights_only", "--help_all", "--checkpoint", "--final"}
    for command in set(COMMANDS) - set(trainer_commands.COMMANDS):
        module = import_module(f"descentflow.cli.{command.replace('-', '_')}_command")
        parser = CommandParser(command, module.run)
        getattr(module, "extend", lambda _: None)(parser)
        known |= {option for action in parser._actions for option in action.option_strings}
    return known


def texts(path: Path) -> list[tuple[int, str]]:
    """Strings in the calls that make errors and in constants, and lines of tables, which messages are made of."""
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".toml":
        return list(enumerate(source.splitlines(), 1))
    parts = [
        node
        for node in ast.walk(ast.parse(source))
        if (isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("Error", "warn")))
        or (isinstance(node, ast.Assign | ast.AnnAssign) and MESSAGES.search(ast.unparse(node).split("=")[0]))
    ]
    inside = [node for part in parts for node in ast.walk(part)]
    return [(n.lineno, n.value) for n in inside if isinstance(n, ast.Constant) and isinstance(n.value, str)]


def test_every_option_that_a_text_names_exists() -> None:
    known, named, wrong = options(), set(), []
    for path in SOURCES:
        for line, text in texts(path):
            for option in OPTION.findall(text):
                named.add(option)
                if option not in known and not option.startswith(("--trainer.", "--model.")):
                    wrong.append(f"{path.name}:{line}: {option}")
    assert not wrong
    assert {"--types", "--data.bada_dir", "--slowest-fpm"} <= named & known, "what the test would overlook"
