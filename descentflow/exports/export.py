"""Write samples or a model for another program: what `descentflow export` calls."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Unpack

from descentflow.core.arguments import Count, Output, Within, checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.core.files import check_output
from descentflow.densities.checkpoint import as_density
from descentflow.exports.descent_graph import Precision
from descentflow.exports.export_request import ExportRequest
from descentflow.exports.targets import target_of
from descentflow.generation.sample_contexts import Contexts
from descentflow.positions.ground_plan import Ground, ground_plan

Interval = Annotated[float, Within(0, 1_000_000)]
"""Seconds, up to some days: times of all samples are within what a calendar holds."""
TYPE = re.compile(r"[A-Z][A-Z0-9]+")
"""An ICAO designator, or a class of types that a program has in its place."""
PREFIX = re.compile(r"[A-Z]+[0-9]*")


@checked_arguments
def export(
    model: object | Sequence[object],
    to: str,
    path: Output,
    *,
    n: Count = 1000,
    seed: int = 0,
    context: Contexts | None = None,
    every_s: Interval = 120.0,
    draw_budget: Count | None = None,
    progress: Callable[[int], None] | None = None,
    precision: Precision = "float64",
    step_s: float | None = None,
    prefix: str = "",
    fly_as: str | Sequence[str] = (),
    **ground: Unpack[Ground],
) -> list[Path]:
    """Write a model's samples, or the model, in the format of another program.

    Args:
        model: A checkpoint's path, a density, or a fitted model; of different types several, where the target takes
            them.
        to: A target of :data:`descentflow.exports.targets.TARGETS`.
        path: The output; some targets write further files in its folder.
        n: Number of samples of each model.
        seed: The same seed gives the same files.
        context: For a conditional model, as in :func:`descentflow.generation.sample.sample`.
        every_s: Seconds from one flight's arrival to the next one's.
        draw_budget: Most draws.
        progress: Progress callback: called with the number of descents newly accepted.
        precision: Of the inputs and outputs of a sampler that is exported itself (``onnx``).
        step_s: Seconds from row to row, on whole steps of the clock; a row for each level if absent, 1 for ``traffic``.
        prefix: Of the callsigns; if empty, three letters that stand for these flights, so that two exports that fly in
            one simulation have two.
        fly_as: Types that a model's samples are flown as, as "A319,A320,A321"; one such text for each model.
        **ground: Where they are flown, the first flight at ``end_time``: arguments of
            :func:`~descentflow.positions.ground_plan.ground_plan`.

    Returns:
        The files that were written.

    Raises:
        CheckpointError: If the checkpoint cannot be used.
        ConfigError: If there is no such target, it needs what was not said, or a library is missing.
        DataError: If the output's folder does not exist.
        SamplingError: If too few draws are plausible.

    Example:
        >>> [path.name for path in export("best.ckpt", "bluesky", "samples.py", n=5)]
        ['samples.py', 'samples.json']
    """
    target = target_of(to)
    target.check_ground(to, [name for name, value in ground.items() if value is not None])
    if prefix and not PREFIX.fullmatch(prefix):
        raise ConfigError(
            f"callsigns that begin {prefix!r}", expected="capital letters, then digits or none", mend="pass KLM"
        )
    densities = [as_density(part) for part in (model if isinstance(model, list | tuple) else [model])]
    if not densities:
        raise ConfigError("no model", expected="one or several", mend="pass a checkpoint's path")
    said = [fly_as] if isinstance(fly_as, str) else list(fly_as)
    first = ExportRequest(
        densities[0],
        check_output(path),
        n=n,
        seed=seed,
        context=context,
        plan=ground_plan(**ground),
        every_s=every_s,
        draw_budget=draw_budget,
        progress=progress,
        precision=precision,
        step_s=target.step_s if step_s is None else step_s,
        prefix=prefix,
        fly_as=tuple(said),
        models=len(densities),
    )
    requests = [replace(first, density=density, first=i) for i, density in enumerate(densities)]
    target.check(to, first)
    types = flown_types(said, [request.typecode for request in requests])
    return target.writer(to)(*(replace(request, fly_as=own) for request, own in zip(requests, types, strict=True)))


def flown_types(said: Sequence[str], typecodes: Sequence[str]) -> list[tuple[str, ...]]:
    """The types of each model.

    Args:
        said: A text for each model, as ``A319,A320,A321``; nothing for the models' own types.
        typecodes: The models' own.

    Raises:
        ConfigError: If there is not one text for each model, a type is none, or two models fly one type.

    Example:
        >>> flown_types(["A319,A320", "B738"], ["A320", "B738"])
        [('A319', 'A320'), ('B738',)]
        >>> flown_types([], ["A320", "A320"])
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: A320 twice; expected each type once, of one model; to mend it, ...
    """
    texts = list(said or typecodes)
    if len(texts) != len(typecodes):
        raise ConfigError(
            f"types {' '.join(texts)} of {len(typecodes)} model{'s' * (len(typecodes) > 1)}",
            expected="types with commas between them, and one such list for each model",
            mend="write for two models for instance --as A319,A320,A321 B738",
        )
    types_of = [tuple(word.strip().upper() for word in text.split(",")) for text in texts]
    every = [word for types in types_of for word in types]
    for word in every:
        if not TYPE.fullmatch(word):
            raise ConfigError(f"type {word!r}", expected="letters and digits", mend="write for instance A320")
        if every.count(word) > 1:
            raise ConfigError(
                f"{word} twice",
                expected="each type once, of one model",
                mend="leave one out, or say by --as which types each model flies",
            )
    return types_of
