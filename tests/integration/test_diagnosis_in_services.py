"""A diagnosis in the programs of others has no process of its own: signals and pools of theirs are no matter."""

import multiprocessing
import os
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


def test_a_diagnosis_begins_no_process(descents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise AssertionError("a process was begun")

    for owner, name in ((os, "fork"), (subprocess, "Popen"), (multiprocessing.Process, "start")):
        monkeypatch.setattr(owner, name, refused)
    few = {name: EFFECTS[name] for name in ("mass", "temperature")}
    df.diagnose(real=descents, simulator="A320", catalogue=few, out=tmp_path / "gap")
    assert (tmp_path / "gap" / "gap.html").is_file()
