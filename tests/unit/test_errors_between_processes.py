"""Errors of a worker reach the process that waits for them: one that cannot be sent breaks the pool."""

import pickle

import numpy as np
import polars as pl
import pytest

from descentflow.core.errors import ConfigError, DataError, DescentflowError, ImplausibleError
from descentflow.core.workers import engine_of
from studies.process_engine import processes

PARTS = {"expected": "a number", "mend": "correct it"}


def refuse(task: int, common: object) -> None:
    raise DataError(f"task {task}", **PARTS)


@pytest.mark.parametrize(
    "error",
    [
        DescentflowError("one", **PARTS),
        ConfigError("two", **PARTS),
        ImplausibleError("three", constraint="cas_kt", nearest=230.0, **PARTS),
    ],
)
def test_an_error_is_the_same_after_it_was_sent(error: DescentflowError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))


def test_an_engine_of_processes_raises_what_its_worker_raised() -> None:
    with pytest.raises(DataError, match=r"task [12]; expected a number; to mend it, correct it"):
        list(processes(2).run(refuse, [1, 2], None))


@pytest.mark.parametrize("engine", [np.zeros((2, 2)), pl.DataFrame({"a": [1]}), 3, ["dask"]])
def test_what_is_no_engine_is_refused(engine: object) -> None:
    """An array has no truth of its own."""
    with pytest.raises(ConfigError, match=r"an engine of type .*; expected local, dask"):
        engine_of(engine)


def test_more_workers_than_any_machine_has_are_refused() -> None:
    with pytest.raises(ConfigError, match="2,147,483,648 workers; expected 1,024 at most"):
        engine_of(workers=1 << 31)
