"""Check that a fit goes on with the model of the run that it resumes; Lightning would take that run's silently."""

from pathlib import Path
from typing import Any

from descentflow.core.errors import CheckpointError
from descentflow.representation.read_checkpoint import SECTION, read_checkpoint

MEND = "use that run's own config.yaml, or leave --ckpt_path out and start a new fit"


def check_resumed_model(checkpoint: Path, asked: Any) -> None:
    """Refuse a checkpoint of another model than the one that is asked for, or of other settings of it.

    Args:
        checkpoint: Of the run that is resumed.
        asked: The model of the options: ``class_path`` and ``init_args``.

    Raises:
        CheckpointError: If it is of another model, or of other settings, or cannot be read.

    Example:
        >>> from argparse import Namespace
        >>> check_resumed_model(Path("best.ckpt"), Namespace(class_path="Gaussian", init_args={}))
        >>> check_resumed_model(Path("best.ckpt"), Namespace(class_path="SplineFlow", init_args={}))
        Traceback (most recent call last):
        descentflow.core.errors.CheckpointError: best.ckpt is of a Gaussian, where the options ask for a SplineFlow; ...
    """
    content = read_checkpoint(checkpoint)
    kept = content.get("hyper_parameters") or {}
    # Only the class's name: models have moved between modules.
    before = str(kept.get("_class_path") or content[SECTION]["model"].removesuffix("Density")).rpartition(".")[2]
    now = str(asked.class_path).rpartition(".")[2]
    if now != before:
        raise CheckpointError(
            f"{checkpoint} is of a {before}, where the options ask for a {now}",
            expected="a checkpoint of the model that is fitted",
            mend=MEND,
        )
    options = dict(vars(asked.init_args)) if hasattr(asked.init_args, "__dict__") else dict(asked.init_args)
    other = [
        f"{n} {kept[n]} (the options: {options[n]})" for n in sorted({*kept} & {*options}) if kept[n] != options[n]
    ]
    if other:
        raise CheckpointError(
            f"{checkpoint} is of a {before} of other settings: {', '.join(other)}",
            expected="the settings of the model of the run that is resumed",
            mend=MEND,
        )
