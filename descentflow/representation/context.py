"""Context of a flight (temperature deviation, wind, operator, hour) as numbers that a density can be conditioned on."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isfinite, pi
from typing import Any, Literal

import polars as pl
import torch
from torch import Tensor

from descentflow.core.errors import ConfigError, DataError

ColumnKind = Literal["number", "category", "hour"]
Missing = Literal["drop", "indicator"]
OTHER = "(other)"
"""Category of the rare and the unseen."""
MIN_OF_A_CATEGORY = 10
"""Training flights below which a category is one of the others."""

MISSING_WORDS = ("", "-", "N/A", "NA", "NAN", "NULL", "NONE")
"""Text, in capitals, that stands for no value."""


@dataclass(frozen=True)
class ContextColumn:
    """Encoding of one column as numbers.

    A number is standardised. An hour becomes the sine and cosine of the day's angle: 23:59 is close to 00:01. A
    category is one 0/1 number for each value but the most frequent. With ``indicator`` one more 0/1 number marks a
    missing value, and the others are then zero.

    Example:
        >>> operator = ContextColumn("operator", "category", values=("AFR", "DLH", "(other)"))
        >>> operator.encode(pl.Series(["DLH", "AFR", "KLM"]))
        tensor([[1., 0.],
                [0., 0.],
                [0., 1.]], dtype=torch.float64)
    """

    name: str
    kind: ColumnKind
    mean: float = 0.0
    scale: float = 1.0
    values: tuple[str, ...] = ()
    """Of a category, the most frequent first."""
    indicator: bool = False
    low: float | None = None
    high: float | None = None
    """Of a number: the least and the most that training flights had; None of other kinds."""

    def beyond(self, series: pl.Series) -> pl.Series:
        """Mask of entries outside of what the training flights had: (n,) bool, missing ones do not."""
        if self.low is None or self.high is None:
            return pl.repeat(False, len(series), eager=True)
        number = series.cast(pl.Float64, strict=False)
        return ((number < self.low) | (number > self.high)).fill_null(False)

    @property
    def width(self) -> int:
        """Count of numbers that it becomes."""
        own = {"number": 1, "hour": 2, "category": len(self.values) - 1}[self.kind]
        return own + int(self.indicator)

    def usable(self, series: pl.Series) -> pl.Series:
        """Mask (n,) of entries that can be encoded as themselves."""
        if self.kind != "category":
            number = series.cast(pl.Float64, strict=False)
            return (number.is_not_null() & number.is_finite()).fill_null(False)
        known = series.cast(pl.String).is_in(self.values).fill_null(False)
        return known | _text(series).is_not_null() if OTHER in self.values else known

    def encode(self, series: pl.Series) -> Tensor:
        """Numbers (n, width), float64; values that cannot be used are zero, with their indicator where there is one."""
        usable = torch.from_numpy(self.usable(series).to_numpy().copy())
        if self.kind == "category":
            named = series.cast(pl.String).fill_null("").to_list()
            index = [self.values.index(v if v in self.values else OTHER) if u else 0
                     for v, u in zip(named, usable.tolist(), strict=True)]  # fmt: skip
            hot = torch.nn.functional.one_hot(torch.tensor(index, dtype=torch.long), len(self.values))
            numbers = hot[:, 1:].double()
        else:
            value = torch.from_numpy(series.cast(pl.Float64, strict=False).fill_null(0.0).to_numpy().copy())
            angle = 2 * pi * value / 24
            columns = [angle.sin(), angle.cos()] if self.kind == "hour" else [(value - self.mean) / self.scale]
            numbers = torch.stack(columns, 1)
        numbers = torch.where(usable[:, None], numbers, 0.0)
        return torch.cat([numbers, (~usable).double()[:, None]], 1) if self.indicator else numbers


DAY_H = 24


class ContextEncoder:
    """Columns of a flight table as (n, width) standardised numbers, fitted on training flights alone.

    Example:
        >>> train = pl.DataFrame({"deviation_k": [0.0, 10.0] * 20, "operator": ["AFR", "AFR", "DLH", "DLH"] * 10})
        >>> encoder = ContextEncoder.fit(train, ["deviation_k", "operator"])
        >>> encoder.encode(train).shape
        torch.Size([40, 2])
        >>> encoder.encode_one({"deviation_k": "5", "operator": "DLH"})
        tensor([[0., 1.]], dtype=torch.float64)
    """

    def __init__(self, columns: Sequence[ContextColumn] = ()) -> None:
        """Hold fitted columns; none for flights without a context."""
        self.columns = tuple(columns)

    @classmethod
    def fit(cls, train: pl.DataFrame, names: Sequence[str], missing: Missing = "drop") -> "ContextEncoder":
        """Learn means, deviations and categories.

        Args:
            train: One row a training flight.
            names: Columns, each number, text or boolean; one called ``hour`` counts as the hour of the day.
            missing: ``drop`` if flights that lack a value are left out, ``indicator`` if missing is a value of its own.

        Raises:
            DataError: If a column is empty or the same for all training flights.
        """
        return cls([_fit_column(train[name], missing == "indicator") for name in names])

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns."""
        return tuple(column.name for column in self.columns)

    @property
    def width(self) -> int:
        """Numbers c that stand for one flight's context."""
        return sum(column.width for column in self.columns)

    def lacking(self, frame: pl.DataFrame) -> dict[str, pl.Series]:
        """For each column without an indicator, which flights cannot be encoded: (n,) bool."""
        return {c.name: ~c.usable(frame[c.name]) for c in self.columns if not c.indicator}

    def check_range(self, frame: pl.DataFrame) -> None:
        """Refuse contexts that no training flight was near: a density does not hold there.

        Args:
            frame: A row for each context.

        Raises:
            ConfigError: If a number lies outside of what the training flights had, or an hour is none of a day.
        """
        for column in (column for column in self.columns if column.kind == "hour"):
            hours = frame[column.name].cast(pl.Float64, strict=False)
            if len(none := frame[column.name].filter(~hours.is_between(0, DAY_H).fill_null(True))):
                raise ConfigError(
                    f"{column.name} = {none[0]}" + (f" (and {len(none) - 1} more)" if len(none) > 1 else ""),
                    expected=f"an hour of the day (UTC), 0 to {DAY_H}",
                    mend="choose an hour in this range",
                )
        for column in self.columns:
            values = frame[column.name].filter(column.beyond(frame[column.name]))
            if len(values):
                raise ConfigError(
                    f"{column.name} = {values[0]}" + (f" (and {len(values) - 1} more)" if len(values) > 1 else ""),
                    expected=f"{column.low:g} to {column.high:g}, as the training flights had",
                    mend="choose values in this range, or fit with flights that had such values",
                )

    def encode(self, frame: pl.DataFrame) -> Tensor:
        """Numbers (n, width) of a flight table, float64; a table without columns is one flight without a context.

        Raises:
            ConfigError: If a column is absent, or a value is missing that has no indicator.
        """
        absent = [name for name in self.names if name not in frame.columns]
        if absent:
            raise ConfigError(
                f"no value for the context {', '.join(absent)}",
                expected=self.describe(),
                mend="pass every column that the model was conditioned on",
            )
        bad = [(name, frame[name].filter(rows)) for name, rows in self.lacking(frame).items() if bool(rows.any())]
        if bad:
            raise ConfigError(
                "; ".join(f"{name} = {values[0]!r}" for name, values in bad),
                expected=self.describe(),
                mend="pass values that the training flights had",
            )
        nothing = torch.zeros(len(frame) if frame.width else 1, 0, dtype=torch.float64)
        return torch.cat([nothing, *(column.encode(frame[column.name]) for column in self.columns)], 1)

    def encode_one(self, values: Mapping[str, Any]) -> Tensor:
        """Numbers (1, width) of one context.

        Args:
            values: Column -> value (text is read as the column's kind); None where an indicator stands for it.

        Raises:
            ConfigError: If a name is unknown, one is left out, or a value cannot be.
        """
        unknown = [name for name in values if name not in self.names]
        if unknown:
            raise ConfigError(
                f"context {', '.join(unknown)}", expected=self.describe(), mend="pass only what the model knows"
            )
        return self.encode(pl.DataFrame({name: [value] for name, value in values.items()}))

    def describe(self) -> str:
        """Names and possible values, for messages."""
        return ", ".join(_describe(column) for column in self.columns) or "none"

    def to_state(self) -> list[dict[str, Any]]:
        """Primitives from which :meth:`from_state` rebuilds it."""
        return [{**asdict(column), "values": list(column.values)} for column in self.columns]

    @classmethod
    def from_state(cls, state: list[dict[str, Any]]) -> "ContextEncoder":
        """Rebuild from :meth:`to_state`; a part of another type is an error (TypeError)."""
        for column in state:
            texts, numbers = [column["name"], column["kind"]], [column[n] for n in ("mean", "scale")]
            numbers += [column[name] for name in ("low", "high") if column.get(name) is not None]
            plain = [isinstance(number, int | float) and not isinstance(number, bool) for number in numbers]
            plain += [*(isinstance(text, str) for text in texts), isinstance(column["indicator"], bool)]
            if not all(plain) or len(numbers) % 2:  # a range has both of its ends, or none
                raise TypeError(f"the context column {column}")
        return cls([ContextColumn(**{**column, "values": tuple(column["values"])}) for column in state])


NO_COLUMNS = ContextEncoder()
"""Of models whose density is not conditioned on any."""


def _describe(column: ContextColumn) -> str:
    if column.kind == "category":
        return f"{column.name} (one of {', '.join(column.values)})"
    if column.kind == "hour":
        return f"{column.name} (hour of the day)"
    seen = "" if column.low is None else f" from {column.low:g} to {column.high:g}"
    return f"{column.name} (a number{seen})"


def _fit_column(series: pl.Series, indicator: bool) -> ContextColumn:
    name = series.name
    if series.dtype.is_numeric():
        return _number(series, indicator)
    if not (series.dtype == pl.String or series.dtype in (pl.Boolean, pl.Categorical, pl.Enum)):
        raise DataError(
            f"context {name} of type {series.dtype}",
            expected="numbers, text or true and false",
            mend="convert the column (a time, for instance, to an hour)",
        )
    known = _text(series).drop_nulls()
    numbers = known.cast(pl.Float64, strict=False)
    if len(known) and not numbers.null_count() and len(known) < series.len() - series.null_count():
        return _number(numbers, indicator)
    if 0 < numbers.null_count() < len(known) / 2:
        raise DataError(
            f"context {name}: {len(known) - numbers.null_count()} numbers, and {known.filter(numbers.is_null())[0]!r}",
            expected="numbers, or text",
            mend="correct the column, or leave missing values empty",
        )
    counts = known.value_counts().sort(["count", name], descending=[True, False])
    often = counts.filter(pl.col("count") >= MIN_OF_A_CATEGORY)[name].to_list()
    rest = [OTHER] if len(often) < len(counts) else []
    if len(often) + len(rest) < 2 and not indicator:
        raise _constant(name, f"the category {counts[name].to_list()}")
    return ContextColumn(name, "category", values=(*often, *rest) or (OTHER,), indicator=indicator)


def _text(series: pl.Series) -> pl.Series:
    """The values as text, null where a word stands for none."""
    text = series.cast(pl.String)
    missing = text.str.strip_chars().str.to_uppercase().is_in(MISSING_WORDS).fill_null(False)
    return text.zip_with(~missing, pl.Series(text.name, [None], dtype=pl.String))


def _number(series: pl.Series, indicator: bool) -> ContextColumn:
    values = [float(v) for v in series.drop_nulls().to_list() if isfinite(v)]
    if series.name == "hour":
        if not values or min(values) < 0 or max(values) > 24:
            raise DataError(f"context hour from {min(values, default=0):g} to {max(values, default=0):g}",
                            expected="hours of the day, 0 to 24", mend="correct the column")  # fmt: skip
        return ContextColumn("hour", "hour", indicator=indicator)
    tensor = torch.tensor(values, dtype=torch.float64)
    if len(values) < 2 or not float(tensor.std()) > 0:
        raise _constant(series.name, "one number" if values else "none")
    moments = float(tensor.mean()), float(tensor.std())
    return ContextColumn(series.name, "number", *moments, indicator=indicator, low=min(values), high=max(values))


def _constant(name: str, got: str) -> DataError:
    return DataError(
        f"context {name}: {got} for all training flights",
        expected="values that vary between flights",
        mend="leave it out of data.context",
    )
