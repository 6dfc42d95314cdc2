"""A diagnosis in the programs of others: beside their signals, in their pools, without a process of its own."""

import multiprocessing
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

import descentflow as df
from descentflow.effects import EFFECTS


@pytest.fixture(autouse=True)
def two_threads() -> Iterator[None]:
    """Two threads of torch, as users have: with one, no version of the diagnosis would begin a process."""
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def verdict_of(descents: str) -> str:
    torch.set_num_threads(2)
    few = {name: EFFECTS[name] for name in ("mass", "temperature")}
    return str(df.diagnose(real=descents, simulator="A320", catalogue=few).verdict)


def test_a_diagnosis_begins_no_process(descents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise AssertionError("a process was begun")

    for owner, name in ((os, "fork"), (subprocess, "Popen"), (multiprocessing.Process, "start")):
        monkeypatch.setattr(owner, name, refused)
    few = {name: EFFECTS[name] for name in ("mass", "temperature")}
    df.diagnose(real=descents, simulator="A320", catalogue=few, out=tmp_path / "gap")
    assert (tmp_path / "gap" / "gap.html").is_file()


def test_a_diagnosis_returns_where_sigterm_is_handled(descents: Path) -> None:
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        assert verdict_of(str(descents)) in ("none", "effect", "partial", "unknown")
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_a_diagnosis_runs_in_a_pool(descents: Path, method: str) -> None:
    # Workers of a pool are daemonic: they may have no processes of their own.
    with multiprocessing.get_context(method).Pool(1) as pool:
        found = pool.apply_async(verdict_of, (str(descents),)).get(timeout=300)
    assert found == verdict_of(str(descents))
