"""Settings of the DataModule and of models in groups, each of which a flat name finds, too."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from inspect import signature
from pathlib import Path
from typing import Any

from jsonargparse.typing import PositiveInt

from descentflow.core.arguments import checked_settings
from descentflow.representation.context import Missing


@checked_settings
@dataclass(frozen=True)
class ContextSettings:
    """Context on which the density is conditioned.

    Attributes:
        context: Columns, see :func:`~descentflow.representation.context_columns.flight_context`; those of the
            checkpoint where one is given.
        context_table: CSV or Parquet with `flight_id` and columns of context.
        missing_context: What becomes of flights that lack a value: ``drop`` or ``indicator``.

    Example:
        >>> ContextSettings(context=["hour", "operator"]).missing_context
        'drop'
    """

    context: list[str] | None = None
    context_table: Path | None = None
    missing_context: Missing = "drop"


@checked_settings
@dataclass(frozen=True)
class BatchSettings:
    """Batches of training flights.

    Attributes:
        batch_size: Flights in a training batch.
        fewest_batches: Batches that an epoch has at least; with few flights they are smaller than ``batch_size``.

    Example:
        >>> BatchSettings(fewest_batches=8).batch_size
        512
    """

    batch_size: PositiveInt = 512
    fewest_batches: PositiveInt = 1


def groups_of(kind: type) -> dict[str, type]:
    """Arguments of a class that are groups of settings: name to dataclass.

    Example:
        >>> from descentflow.training.datamodule import DescentDataModule
        >>> groups_of(DescentDataModule)["split"].__name__
        'SplitSettings'
    """
    usual = {name: type(one.default) for name, one in signature(kind).parameters.items()}
    return {name: group for name, group in usual.items() if is_dataclass(group)}


def grouped(options: Mapping[str, Any], groups: Mapping[str, type]) -> dict[str, Any]:
    """Options with those in their groups that are given by a flat name.

    Example:
        >>> from descentflow.training.datamodule import DescentDataModule
        >>> options = {"seed": 3, "air": "measured", "split": {"split_by": "aircraft"}}
        >>> grouped(options, groups_of(DescentDataModule))
        {'air': 'measured', 'split': {'split_by': 'aircraft', 'seed': 3}}
    """
    group_of = {field.name: name for name, group in groups.items() for field in fields(group)}
    in_groups = {name: value for name, value in options.items() if name not in group_of}
    for name, value in options.items():
        if name in group_of:
            before = in_groups.get(group_of[name]) or {}
            in_groups[group_of[name]] = {**(vars(before) if is_dataclass(before) else before), name: value}
    return in_groups
