"""Public calls with an argument that is wrong, or several: what the cases of arguments are."""

import datetime
import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import torch

from fuzzing.calls import calls

VALUES: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "True": lambda: True,
    "0": lambda: 0,
    "-1": lambda: -1,
    "-1.5": lambda: -1.5,
    "2.5": lambda: 2.5,
    "nan": lambda: math.nan,
    "inf": lambda: math.inf,
    "2^64": lambda: 2**64,
    "1e300": lambda: 1e300,
    "a complex number": lambda: 1j,
    "an empty text": lambda: "",
    "a text": lambda: "no such thing",
    "digits": lambda: "12",
    "a text with a zero byte": lambda: "a\0b",
    "a text of 300 letters": lambda: "x" * 300,
    "half a letter": lambda: "\ud800",
    "bytes": lambda: b"A320",
    "a path that is not there": lambda: Path("no_such_folder/no_such_file.parquet"),
    "a folder": lambda: Path(),
    "an empty list": list,
    "a list of None": lambda: [None],
    "a list of a text": lambda: ["no such thing"],
    "a list of numbers": lambda: [1.0, math.nan],
    "a pair of None": lambda: (None, None),
    "a pair the wrong way round": lambda: (900.0, -900.0),
    "a set": lambda: {1, 2},
    "an empty dictionary": dict,
    "a dictionary": lambda: {"no such thing": 1},
    "a dictionary of numbers": lambda: {-5: math.nan},
    "a generator": lambda: (one for one in ()),
    "a class": lambda: object,
    "a function without arguments": lambda: lambda: None,
    "an object": object,
    "a time": lambda: datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC),
    "an empty table": pl.DataFrame,
    "a table": lambda: pl.DataFrame({"flight_id": ["a", None], "no such thing": [1.0, None]}),
    "a table of pandas": lambda: pd.DataFrame({"flight_id": ["a", None], "no such thing": [1.0, None]}),
    "a column": lambda: pl.Series("a", [1, 2]),
    "an array": lambda: np.zeros((2, 2)),
    "a number of NumPy": lambda: np.float32(-3),
    "a tensor": lambda: torch.full((2, 3), math.nan),
}
"""Name of a wrong value -> what makes it."""


def every_pair(good: Path) -> list[tuple[str, str, str]]:
    """Call, parameter and value of each case that has one wrong argument."""
    return [
        (name, parameter, value)
        for name, call in calls(good).items()
        for parameter in call.parameters
        for value in VALUES
    ]


def some_pairs(rng: random.Random, good: Path) -> list[str]:
    """Words of a case with two or three wrong arguments of one call."""
    name = rng.choice(list(calls(good)))
    parameters = calls(good)[name].parameters
    chosen = rng.sample(parameters, min(rng.choice((2, 2, 3)), len(parameters)))
    return [name, *(word for parameter in chosen for word in (parameter, rng.choice(list(VALUES))))]


def run(good: Path, name: str, *pairs: str) -> None:
    """Call a function with wrong values in place of some of its right arguments."""
    call = calls(good)[name]
    wrong = {pairs[i]: VALUES[pairs[i + 1]]() for i in range(0, len(pairs), 2)}
    call.function(**{**call.right, **wrong})
