"""The cases: by its number and a seed, each is a damaged file and the command that is given it."""

import json
import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import polars as pl
import torch
import yaml

from fuzzing import loggers, wrong_arguments
from fuzzing.byte_changes import damaged, running_code, wrapped
from fuzzing.outputs import bad_place, by_another_clock
from fuzzing.table_changes import changed
from fuzzing.values import NUMBERS, TEXTS, mutate_tree, odd_value
from fuzzing.weather_changes import write_damaged

SAMPLES = "5"
COMMANDS = {"predict-descent": 0.7, "evaluate": 0.15, "fit": 0.1, "diagnose": 0.05}
"""Shares of what damaged descents are given to: a fit or an evaluation takes two seconds, a diagnosis ten."""


ARGUMENTS, CODE_RAN = "arguments", "code_ran"
MANY = 1000.0


@dataclass(frozen=True)
class Case:
    """Command or call of a case.

    Attributes:
        kind: Of input.
        words: Of the command line; or the name of a function and its arguments where no short command reads the input;
            or a public call and its wrong arguments.
        out: What the command writes.
        rows: Rows of the input, where they are known.
        others: Files in the case's folder that are not its own, each with its name in it.
    """

    kind: str
    words: list[str]
    out: Path | None = None
    rows: int | None = None
    others: tuple[str, ...] = ()


def build(number: int, seed: int | str, good: Path, folder: Path, kind: str | None = None) -> Case:
    """Write the damaged file of a case into a folder and say what is to be run.

    Args:
        number: Of the case.
        seed: Of the whole run; or ``arguments`` for every wrong value of every argument, one after the other.
        good: Folder of whole files.
        folder: Empty folder for the case's own.
        kind: Of input, one of :data:`KINDS`; by their shares if absent.
    """
    if seed == ARGUMENTS:
        name, *pair = wrong_arguments.every_pair(good)[number]
        return _call(good, name.replace(" ", "-"), name, *pair)
    rng = random.Random(f"{seed}-{number}")
    chosen = rng.choices(list(KINDS), [weight for _, weight in KINDS.values()])[0]
    return KINDS[kind or chosen][0](rng, good, folder)


def _source(rng: random.Random, good: Path, folder: Path) -> Case:
    name = rng.choice(sorted(path.name for path in (good / "sources").iterdir()))
    content, target = damaged((good / "sources" / name).read_bytes(), rng), name
    if rng.random() < 0.15:
        content, target = wrapped((good / "sources" / name).read_bytes(), name, rng)
    (folder / target).write_bytes(content)
    return _prepare(f"source {name}", folder, folder / target, rng)


def _rows(rng: random.Random, good: Path, folder: Path) -> Case:
    frame = changed(pl.read_parquet(good / "sources" / "parquet"), rng)
    path = folder / f"rows.{rng.choice(('parquet', 'csv', 'feather', 'json'))}"
    try:
        _write(frame, path)
    except BaseException:  # CSV has no lists, JSON no bytes: Polars raises or panics
        path = folder / "rows.parquet"
        _write(frame, path)
    return _prepare("rows", folder, path, rng, None if path.suffix == ".json" else frame.height)


def _write(frame: pl.DataFrame, path: Path) -> None:
    if path.suffix == ".json":
        frame.write_json(path)
    elif path.suffix == ".csv":
        frame.write_csv(path)
    elif path.suffix == ".feather":
        frame.write_ipc(path)
    else:
        frame.write_parquet(path)


def _prepare(kind: str, folder: Path, path: Path, rng: random.Random, rows: int | None = None) -> Case:
    out = folder / "out.parquet"
    more = ["--typecode", "A320"] if rng.random() < 0.2 else []
    words = ["prepare", str(path), "--out", str(out), "--report", str(folder / "report.json"), "--workers", "1", *more]
    return Case(kind, words, out, rows)


def _clock(rng: random.Random, good: Path, folder: Path) -> Case:
    """Rows by another clock, of which some have tables of level flight made, too."""
    frame = by_another_clock(pl.read_parquet(good / "sources" / "parquet"), rng)
    path = folder / rng.choice(("rows.parquet", "rows.csv"))
    _write(frame, path)
    return _prepare("clocks", folder, path, rng, frame.height)


def _level_flight(rng: random.Random, good: Path, folder: Path) -> Case:
    """Tables of level flight of rows that are damaged, a few columns of many flights."""
    rows = pl.read_parquet(good / "rows.parquet")
    few = rows.filter(pl.col("flight_id").is_in(rows["flight_id"].unique().sort().head(3).implode()))
    frame, path = changed(few, rng), folder / "rows.parquet"
    frame.write_parquet(path)
    case = _prepare("level flight", folder, path, rng, frame.height)
    return replace(case, words=[*case.words, "--level-flight", str(folder / "level")])


def _place(rng: random.Random, good: Path, folder: Path) -> Case:
    """A command whose output cannot be written, or hardly."""
    plain, rows = str(good / "plain.ckpt"), str(good / "sources" / "parquet")
    commands = {
        "sample": ([plain, "-n", SAMPLES], ".parquet"),
        "prepare": ([rows, "--workers", "1"], ".parquet"),
        "simulate": (["--typecode", "A320", "--flights", "1"], ".parquet"),
        "export": ([plain, "--to", "bluesky", "-n", SAMPLES], ".scn"),
    }
    name = rng.choice(list(commands))
    words, suffix = commands[name]
    return Case("places", [name, *words, "--out", str(bad_place(folder, suffix, rng))])


def _repair(rng: random.Random, good: Path, folder: Path) -> Case:
    """A repair by descents that are damaged, to a file of coefficients."""
    path, whole = folder / "descents.parquet", good / "descents.parquet"
    kept = {name: text for name, text in pl.read_parquet_metadata(whole).items() if name != "ARROW:schema"}
    changed(pl.read_parquet(whole), rng).write_parquet(path, metadata=kept)
    out = folder / "A320.toml"
    return Case("repair", ["repair", str(path), "--aircraft", "A320", "--out", str(out)], out)


def _descents(rng: random.Random, good: Path, folder: Path) -> Case:
    whole = good / "descents.parquet"
    path, key = folder / "descents.parquet", "descentflow"
    about = pl.read_parquet_metadata(whole)
    frame = pl.read_parquet(whole)
    if rng.random() < 0.15:
        path.write_bytes(damaged(whole.read_bytes(), rng))
    elif rng.random() < 0.2:
        key = next(name for name in about if name != "ARROW:schema")
        frame.write_parquet(path, metadata={key: json.dumps(mutate_tree(json.loads(about[key]), rng))})
    else:
        kept = {name: text for name, text in about.items() if name != "ARROW:schema"}
        changed(frame, rng).write_parquet(path, metadata=kept)
    plain, out = str(good / "plain.ckpt"), folder / "out"
    read = str(path)
    off = ("--trainer.logger", "false", "--trainer.max_epochs=1")
    words = {
        "predict-descent": (plain, read, "--from-fl", "290", "--out", f"{out}.parquet"),
        "evaluate": (plain, "--real", read, "--out", str(out), "-n", "100"),
        "fit": ("--model", "Gaussian", "--data.descents", read, *off),
        "diagnose": ("--real", read, "--typecode", "A320", "--out", str(out)),
    }
    name = rng.choices(list(COMMANDS), list(COMMANDS.values()))[0]
    written = {"predict-descent": Path(f"{out}.parquet"), "evaluate": out, "diagnose": out}
    return Case("descents", [name, *words[name]], written.get(name))


def _checkpoint(rng: random.Random, good: Path, folder: Path) -> Case:
    whole = good / rng.choice(("plain.ckpt", "context.ckpt", "corrected.ckpt"))
    path, out = folder / "damaged.ckpt", folder / "out.parquet"
    if rng.random() < 0.1:
        path.write_bytes(running_code(whole.read_bytes(), folder / CODE_RAN, rng))
    elif rng.random() < 0.2:
        path.write_bytes(damaged(whole.read_bytes(), rng))
    else:
        torch.save(mutate_tree(torch.load(whole, weights_only=True), rng, lambda old: _odd_entry(old, rng)), path)
    given = ["--given", "entry_fl=340"] if whole.name == "context.ckpt" else []
    if rng.random() < 0.2:
        return Case("checkpoint", ["info", str(path)])
    return Case("checkpoint", ["sample", str(path), "-n", SAMPLES, "--out", str(out), *given], out)


def _odd_entry(old: Any, rng: random.Random) -> Any:
    """In place of a tensor: one of another shape, type or content; in place of anything else: anything."""
    if not isinstance(old, torch.Tensor) or rng.random() < 0.2:
        return odd_value(rng)
    changes: tuple[Callable[[], Any], ...] = (
        lambda: torch.full_like(old, rng.choice((-1, 0, 1))),
        lambda: old.double() * float("nan"),
        lambda: old.double() * rng.choice((-1.0, 1e30, 1e300, float("inf"))),
        lambda: old.flatten()[: rng.randrange(max(old.numel(), 1))],
        lambda: torch.cat([old.flatten(), old.flatten()]),
        lambda: old.unsqueeze(0),
        lambda: old.to(rng.choice((torch.int32, torch.bool, torch.float16, torch.complex64))),
        lambda: torch.empty(0),
    )
    return rng.choice(changes)()


def _bada(rng: random.Random, good: Path, folder: Path) -> Case:
    if rng.random() < 0.5:
        shutil.copytree(good / "bada4", folder / "bada4")
        name = rng.choice(("Dummy-TWIN", "Dummy-TBP"))
        path = folder / "bada4" / rng.choice((f"{name}/{name}.xml", f"{name}/{name}.xml", "GPF.xml", "ACM_BADA4.xsd"))
        if path.suffix == ".xml" and rng.random() < 0.5:
            (folder / "bada4" / "ACM_BADA4.xsd").unlink()
        path.write_bytes(damaged(path.read_bytes(), rng))
        return Case("BADA 4 files", ["call", "aircraft", name, str(folder / "bada4")])
    for path in sorted((good / "bada").iterdir()):
        (folder / path.name).write_bytes(path.read_bytes())
    changed_file = rng.choice(("J2M___.OPF", "J2M___.OPF", "J2M___.APF", "BADA.GPF", "SYNONYM.NEW"))
    path = folder / changed_file
    path.write_bytes(damaged(path.read_bytes(), rng))
    return Case("BADA files", ["call", "aircraft", "J2M", str(folder)])


def _settings(rng: random.Random, good: Path, folder: Path) -> Case:
    name = rng.choice(("fit.yaml", "prepare.yaml"))
    text, path = (good / name).read_bytes(), folder / name
    tree = rng.random() < 0.6
    path.write_bytes(yaml.safe_dump(mutate_tree(yaml.safe_load(text), rng)).encode() if tree else damaged(text, rng))
    if name == "prepare.yaml":
        out = folder / "out.parquet"
        rows = str(good / "sources" / "parquet")
        return Case("settings", ["prepare", rows, "--out", str(out), "--config", str(path), "--workers", "1"], out)
    return Case("settings", ["fit", "--config", str(path), "--data.descents", str(good / "descents.parquet")])


def _table(rng: random.Random, good: Path, folder: Path) -> Case:
    """Tables next to the flights: contexts that are given, and types by address."""
    name = rng.choice(("given.csv", "types.csv"))
    path, out = folder / name, folder / "out.parquet"
    path.write_bytes(damaged((good / name).read_bytes(), rng))
    if name == "given.csv":
        words = ["sample", str(good / "context.ckpt"), "-n", SAMPLES, "--given-table", str(path)]
    else:
        words = ["prepare", str(good / "sources" / "parquet"), "--types", str(path), "--workers", "1"]
    return Case("tables", [*words, "--out", str(out)], out)


def _gap(rng: random.Random, good: Path, folder: Path) -> Case:
    whole, path = (good / "gap.json").read_bytes(), folder / "gap.json"
    tree = rng.random() < 0.7
    path.write_bytes(json.dumps(mutate_tree(json.loads(whole), rng)).encode() if tree else damaged(whole, rng))
    return Case("gap.json", ["call", "read_gap", str(path)])


def _options(rng: random.Random, good: Path, folder: Path) -> Case:
    """A command that would work but for one or two options."""
    plain, out = str(good / "plain.ckpt"), folder / "out.parquet"
    number = rng.choice((*NUMBERS, *TEXTS))
    value = str(number)
    many = isinstance(number, int | float) and not number < MANY
    commands = {
        "sample": ([plain, "-n", SAMPLES], ("-n", "--seed", "--draw-budget", "--given", "--end", "--track", "--wind")),
        "predict-descent": ([plain, str(good / "descents.parquet")], ("--from-fl", "-n", "--seed")),
        "prepare": (
            [str(good / "sources" / "parquet"), "--workers", "1"],
            ("--memory", "--workers", "--bottom-fl", "--stale-s", "--fewest-levels", "--format", "--typecode"),
        ),
        "simulate": (["--typecode", "A320", "--flights", "3"], ("--flights", "--seed", "--typecode", "--plant")),
    }
    name = rng.choice(list(commands))
    words, options = commands[name]
    if many:  # so many descents are made, and that takes what it takes
        options = tuple(option for option in options if option not in ("-n", "--flights"))
    chosen = [word for option in rng.sample(options, rng.choice((1, 1, 2))) for word in (option, value)]
    return Case("options", [name, *words, "--out", str(out), *chosen], out)


def _weather(rng: random.Random, good: Path, folder: Path) -> Case:
    """A field, mostly read at places where its values are known, else by `sample`."""
    path, exact = write_damaged(folder, rng)
    if rng.random() < 0.9:
        return Case("weather", ["call", "weather", str(path), str(rng.randrange(10**6)), "exact" if exact else "any"])
    out = folder / "out.parquet"
    where = ["--end", "52,5", "--track", "250", "--time", "2024-03-03T12:00:00", "--out", str(out)]
    option = rng.choice(("--air", "--wind"))
    return Case("weather", ["sample", str(good / "plain.ckpt"), "-n", SAMPLES, option, str(path), *where], out)


def _logger(rng: random.Random, good: Path, folder: Path) -> Case:
    for name in loggers.OTHERS:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    return Case("loggers", loggers.words_of_fit(rng, good / "descents.parquet"), others=loggers.OTHERS)


def _arguments(rng: random.Random, good: Path, folder: Path) -> Case:
    """A call of the package with several wrong arguments."""
    return _call(good, ARGUMENTS, *wrong_arguments.some_pairs(rng, good))


def _call(good: Path, kind: str, *words: str) -> Case:
    return Case(f"{kind} {' '.join(words[1:])}", ["argument", str(good), *words])


KINDS: dict[str, tuple[Callable[[random.Random, Path, Path], Case], float]] = {
    "source": (_source, 0.43),
    "rows": (_rows, 0.20),
    "descents": (_descents, 0.03),
    "checkpoint": (_checkpoint, 0.10),
    "bada": (_bada, 0.07),
    "settings": (_settings, 0.03),
    "tables": (_table, 0.04),
    "gap": (_gap, 0.07),
    "options": (_options, 0.03),
    "weather": (_weather, 0.10),
    "arguments": (_arguments, 0.03),
    "loggers": (_logger, 0.01),
    "clocks": (_clock, 0.05),
    "level-flight": (_level_flight, 0.01),
    "places": (_place, 0.02),
    "repair": (_repair, 0.005),
}
"""Kind of input -> what makes a case of it, and its share."""
