"""Commands to kill, with what each writes and how it is run again."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

SCRIPTS = Path(__file__).resolve().parents[1]
FLIGHTS_BYTES = 4_000_000
"""Bound on memory at which a hundred flights are spread over partitions on disk."""


@dataclass(frozen=True)
class Job:
    """A command.

    Attributes:
        words: What is run, in a folder of its own.
        products: Patterns of the files that it writes and that must be the same.
        again: Words with which it is run again after it was killed, of the folder; the same words if absent.
        spares_parent: Whether a process that the command began is killed in its place; it must end well by itself then,
            or with a message, after which it is run again.
        always_anew: Whether it begins processes that import what it is, so that it may not be forked.
    """

    words: tuple[str, ...]
    products: tuple[str, ...]
    again: Callable[["Job", Path], tuple[str, ...]] | None = None
    spares_parent: bool = False
    always_anew: bool = False


def jobs(inputs: Path) -> dict[str, Job]:
    """Every command by name.

    Args:
        inputs: Folder of what they read (:func:`killing.inputs.make`).
    """
    rows, descents, model = (str(inputs / name) for name in ("rows.parquet", "descents.parquet", "plain.ckpt"))
    real = str(inputs / "warm.parquet")
    command = (sys.executable, "-m", "descentflow")
    study = (sys.executable, str(SCRIPTS / "paper_study.py"), "out", "--store", descents, "--types", "A320")
    study += ("--models", "gaussian,gmm", "--samples", "200")
    fits = {
        f"fit {name}": Job(
            (*command, "fit", "--config", name, "--data.descents", descents, "--trainer.max_epochs", epochs, *logger),
            ("runs/*/version_*/checkpoints/*.ckpt", "runs/*/version_*/config.yaml"),
        )
        for name, epochs, logger in (
            ("gaussian", "1", _without_figures("gaussian")),
            ("gmm", "20", _without_figures("gmm")),
            ("flow", "4", _without_figures("flow")),
        )
    }
    resumed = {
        f"{name}, resumed": Job(fits[name].words, fits[name].products, resume) for name in ("fit gmm", "fit flow")
    }
    exports = {
        f"export {target}": Job(
            (*command, "export", model, "--to", target, "--out", out, "-n", "50", *places), (f"{Path(out).stem}*",)
        )
        for target, out, places in (
            ("bluesky", "out.py", ()),
            ("traffic", "out.parquet", ("--end", "51.47,-0.45", "--track", "270", "--time", "2026-11-22T10:00:00")),
        )
    }
    return {
        "prepare, a file": Job(_prepared(rows, "out.parquet"), ("out.parquet",)),
        "prepare, a store": Job(_prepared(rows, "out"), ("out/**/*",)),
        "prepare, a Dask worker": Job(
            _prepared(rows, "out", "dask"), ("out/**/*",), spares_parent=True, always_anew=True
        ),
        **fits,
        **resumed,
        "sample": Job((*command, "sample", model, "-n", "3000", "--out", "out.csv"), ("out.csv",)),
        "evaluate": Job((*command, "evaluate", model, "--real", real, "--out", "out", "-n", "300"), ("out/*",)),
        "diagnose": Job((*command, "diagnose", "--simulator", model, "--real", real, "--out", "out"), ("out/*",)),
        "watch": Job(
            (*command, "watch", "A320", str(inputs / "days"), "--state", "out", "--reference-days", "8"), ("out/*",)
        ),
        **exports,
        "study": Job(study, STUDY),
        "study, two processes": Job((*study, "--workers", "2"), STUDY, always_anew=True),
        "study, a process": Job((*study, "--workers", "2"), STUDY, spares_parent=True, always_anew=True),
        "study, a Dask worker": Job(
            (*study, "--engine", "dask", "--workers", "2"), STUDY, spares_parent=True, always_anew=True
        ),
    }


STUDY = ("out/*.csv", "out/A320/*.parquet", "out/A320/*/scores.csv", "out/A320/*/best.ckpt", "out/A320/*.csv")


def _without_figures(name: str) -> tuple[str, ...]:
    """Options of a fit whose log is a table: figures for TensorBoard take most of a short fit, and none is compared."""
    logger = "--trainer.logger"
    return logger, "lightning.pytorch.loggers.CSVLogger", f"{logger}.save_dir", "runs", f"{logger}.name", name


def _prepared(rows: str, out: str, engine: str = "local") -> tuple[str, ...]:
    code = (
        "from descentflow.cli.ending import ended_in_order\n"
        "with ended_in_order('prepare'):\n"
        "    import descentflow as df\n"
        f"    df.prepare({rows!r}, out={out!r}, memory_bytes={FLIGHTS_BYTES}, engine={engine!r}, workers=2)"
    )
    return sys.executable, "-c", code


def resume(job: Job, folder: Path) -> tuple[str, ...]:
    """Words that resume the last run of a folder; those that begin anew if it left no checkpoint."""
    left = sorted(folder.glob("runs/*/version_*/checkpoints/last.ckpt"))
    if not left:
        return job.words
    run = left[-1].parents[1]
    return (*job.words[:3], "fit", "--config", str(run / "config.yaml"), "--ckpt_path", str(left[-1]))
