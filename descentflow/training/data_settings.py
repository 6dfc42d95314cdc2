"""Settings of the DataModule: what is held out, how flights become weights, context and batches."""

from dataclasses import dataclass
from pathlib import Path

from jsonargparse.typing import PositiveInt

from descentflow.core.arguments import checked_settings
from descentflow.representation.context import Missing
from descentflow.representation.fit_representation import RepresentationSettings
from descentflow.training.splitting import SplitSettings


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


@checked_settings
@dataclass(frozen=True)
class DataSettings(SplitSettings, RepresentationSettings, ContextSettings, BatchSettings):
    """All settings of the DataModule that are no place of data; a run's `config.yaml` has them by the same names.

    Example:
        >>> settings = DataSettings(split_by="aircraft", fewest_batches=8)
        >>> settings.seed, settings.explained_variance, settings.batch_size
        (0, 0.8, 512)
    """
