"""Fixtures shared by all tests."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import torch

if TYPE_CHECKING:
    from descentflow.measurements.quantities import Quantities

# Small matrices gain nothing from threads, and lose tenfold to them where several runs share the cores.
torch.set_num_threads(1)


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the reference material that is kept beside the repository and not inside it."""
    folder = Path(__file__).resolve().parents[2] / "shared"
    if not folder.is_dir():
        pytest.skip("reference material (../shared beside the repository) is not on this machine")
    return folder


@pytest.fixture(scope="module")
def components_once() -> Iterator[None]:
    """Profiles that a test of this process fitted before keep their components: for files that fit the same flights."""
    from kept_components import keep_components

    with pytest.MonkeyPatch.context() as patch:
        keep_components(patch)
        yield


@pytest.fixture(scope="module")
def plain_figures() -> Iterator[None]:
    """Evaluations in this process write empty figures: for files that look at none."""
    from plain_figures import draw_plain

    with pytest.MonkeyPatch.context() as patch:
        draw_plain(patch)
        yield


@pytest.fixture
def real_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """The real ones again, for one test."""
    import plain_figures

    from descentflow.evaluation.evaluation_report import Evaluation

    monkeypatch.setattr(Evaluation, "figures", plain_figures.REAL)


@pytest.fixture(scope="session")
def halves(tmp_path_factory: pytest.TempPathFactory) -> "tuple[Quantities, Quantities]":
    """Measured flights of two halves of one world's aircraft, some 100 each."""
    import gap_toys

    from descentflow.measurements.quantities import quantities_of
    from descentflow.measurements.quantity_registry import CHANNELS
    from descentflow.surveillance.descents.prepared_descents import read_descents

    path = gap_toys.flights(tmp_path_factory.mktemp("gap"), 200, seed=3)
    every = quantities_of(read_descents(path).frame, 150, 360, CHANNELS)
    first = every.airframe % 2 == 0
    return every.rows(first), every.rows(~first)
