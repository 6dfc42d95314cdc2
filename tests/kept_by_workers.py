"""Results of one test, kept for the other tests of a session in a folder that all of its workers share.

A worker that asks for what another one is just finding waits for it. Each session of pytest has a folder of its own, so
that nothing outlives a change of the code.
"""

import dataclasses
import fcntl
import hashlib
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import pytest
import torch
from torch import Tensor

T = TypeVar("T")


def folder_of_workers(factory: pytest.TempPathFactory, name: str) -> Path:
    """A folder of this name, the same one for all workers of the session."""
    base = factory.getbasetemp()
    # Under xdist each worker has a folder of its own in the session's.
    place = (base.parent if base.name.startswith("popen-") else base) / f"shared-{name}"
    place.mkdir(exist_ok=True)
    return place


def once(folder: Path, name: str, make: Callable[[], T]) -> T:
    """Result of ``make``, from the first who asks for it by this name; everyone gets a copy."""
    path = folder / name
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            made = make()
            part = path.with_suffix(".part")
            part.write_bytes(pickle.dumps(made))
            part.rename(path)
            return made
    kept: T = pickle.loads(path.read_bytes())
    return kept


def digest(*values: Any) -> str:
    """A name for values, to the bit: tensors, dataclasses of them, and whatever is identified by its ``repr``."""
    state = hashlib.sha256()
    for value in values:
        _add(state, value)
    return state.hexdigest()


def _add(state: Any, value: Any) -> None:
    if isinstance(value, Tensor):
        state.update(repr((value.shape, value.dtype)).encode())
        state.update(value.detach().cpu().contiguous().reshape(-1).view(torch.uint8).numpy().tobytes())
    elif dataclasses.is_dataclass(value):
        state.update(type(value).__name__.encode())
        for field in dataclasses.fields(value):
            state.update(field.name.encode())
            _add(state, getattr(value, field.name))
    else:
        state.update(repr(value).encode())
