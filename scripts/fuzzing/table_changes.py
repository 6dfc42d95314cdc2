"""Damage to tables: columns gone, renamed, of other types, and values that mean something else or nothing."""

import random
from collections.abc import Callable
from datetime import UTC, datetime

import polars as pl

from fuzzing.values import LONG_TEXT, NUMBERS, TEXTS

EDGES = (datetime(1, 1, 1, tzinfo=UTC), datetime(1969, 12, 31, tzinfo=UTC), datetime(9999, 12, 31, 23, 59, tzinfo=UTC))
TYPES = (
    pl.String,
    pl.Float32,
    pl.Int8,
    pl.Int64,
    pl.UInt64,
    pl.Boolean,
    pl.Binary,
    pl.Categorical,
    pl.Date,
    pl.Duration,
)
FACTORS = (0.0, -1.0, 1e-3, 0.3048, 0.5144, 10.0, 1e3, 1e30)


def changed(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    """One to three changes of a table."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        frame = rng.choice(CHANGES)(frame, rng)
    return frame


def _some(frame: pl.DataFrame, rng: random.Random) -> pl.Series:
    """Choose rows: one, a tenth, half, or all."""
    share = rng.choice((0.0, 0.1, 0.5, 1.0))
    always = rng.randrange(max(frame.height, 1))
    return pl.Series([i == always or rng.random() < share for i in range(frame.height)], dtype=pl.Boolean)


def _replaced(frame: pl.DataFrame, name: str, value: object, rng: random.Random) -> pl.DataFrame:
    new = pl.lit(value)
    if isinstance(value, str) and frame.schema[name] != pl.String:
        frame = frame.with_columns(pl.col(name).cast(pl.String, strict=False))
    elif isinstance(value, float) and frame.schema[name].is_integer():
        frame = frame.with_columns(pl.col(name).cast(pl.Float64))
    return frame.with_columns(pl.when(_some(frame, rng)).then(new).otherwise(pl.col(name)).alias(name))


def _value(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    name = rng.choice(frame.columns)
    kind = frame.schema[name]
    if kind.is_numeric():
        return _replaced(frame, name, float(rng.choice(NUMBERS)), rng)
    if kind.is_temporal():
        return _replaced(frame, name, rng.choice(EDGES), rng)
    long = "x" * (LONG_TEXT if frame.height < 100 else 1000)
    return _replaced(frame, name, rng.choice((*TEXTS, long)), rng) if kind == pl.String else frame


def _scaled(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    names = [name for name, kind in frame.schema.items() if kind.is_numeric()]
    if not names:
        return frame
    name = rng.choice(names)
    return frame.with_columns(pl.col(name).cast(pl.Float64) * rng.choice(FACTORS))


def _constant(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    name = rng.choice(frame.columns)
    return frame.with_columns(pl.col(name).first()) if frame.height else frame


def _null(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    name = rng.choice(frame.columns)
    return frame.with_columns(pl.when(_some(frame, rng)).then(None).otherwise(pl.col(name)).alias(name))


def _of_type(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    name = rng.choice(frame.columns)
    try:
        return frame.with_columns(pl.col(name).cast(rng.choice(TYPES), strict=False))
    except pl.exceptions.PolarsError:  # there is no such cast
        return frame.with_columns(pl.struct(name).alias(name))


def _nested(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    name = rng.choice(frame.columns)
    return frame.with_columns(rng.choice((pl.struct(name), pl.concat_list(name))).alias(name))


def _renamed(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    name = rng.choice(frame.columns)
    new = rng.choice(("", name.upper(), name + " ", "x" * 300, "=1+1", "<b>"))
    return frame if new in frame.columns else frame.rename({name: new})


def _swapped(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    first, second = rng.choice(frame.columns), rng.choice(frame.columns)
    return frame if first == second else frame.rename({first: second, second: first})


def _of_another(frame: pl.DataFrame, rng: random.Random) -> pl.DataFrame:
    """Some values of a column are those of another one, or one number that stands for none."""
    numbers = [name for name, kind in frame.schema.items() if kind.is_float()]
    if len(numbers) < 2:
        return frame
    name, other = rng.sample(numbers, 2)
    false = rng.choice((pl.col(other), pl.lit(float(rng.choice((-64, 0, 127, 9999, 4095))))))
    return frame.with_columns(pl.when(_some(frame, rng)).then(false).otherwise(pl.col(name)).alias(name))


CHANGES: tuple[Callable[[pl.DataFrame, random.Random], pl.DataFrame], ...] = (
    _value,
    _value,
    _value,
    _scaled,
    _constant,
    _null,
    _of_type,
    _nested,
    _renamed,
    _swapped,
    _of_another,
    lambda frame, rng: frame.drop(rng.choice(frame.columns)) if frame.width > 1 else frame,
    lambda frame, rng: frame.head(rng.choice((0, 1, 2))),
    lambda frame, rng: pl.concat([frame.head(1)] * max(frame.height, 1)),
    lambda frame, rng: frame.sample(fraction=1.0, shuffle=True, seed=rng.randrange(1000)) if frame.height else frame,
    lambda frame, rng: pl.concat([frame, frame]),
)
