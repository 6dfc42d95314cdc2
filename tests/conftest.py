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
def components_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Profiles that a test of this session fitted before keep their components: for files that fit the same flights."""
    from kept_by_workers import folder_of_workers
    from kept_components import keep_components

    with pytest.MonkeyPatch.context() as patch:
        keep_components(patch, folder_of_workers(tmp_path_factory, "components"))
        yield


@pytest.fixture(scope="module")
def worlds_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Flights that a test of this session flew before are not flown again: for files that only need a world."""
    from kept_by_workers import folder_of_workers
    from kept_worlds import keep_worlds

    with pytest.MonkeyPatch.context() as patch:
        keep_worlds(patch, folder_of_workers(tmp_path_factory, "worlds"))
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
    from kept_by_workers import folder_of_workers, once

    from descentflow.measurements.quantities import quantities_of
    from descentflow.measurements.quantity_registry import CHANNELS
    from descentflow.surveillance.descents.prepared_descents import read_descents

    def measured() -> "Quantities":
        path = gap_toys.flights(tmp_path_factory.mktemp("gap"), 200, seed=3)
        return quantities_of(read_descents(path).frame, 150, 360, CHANNELS)

    every = once(folder_of_workers(tmp_path_factory, "halves"), "halves", measured)
    first = every.airframe % 2 == 0
    return every.rows(first), every.rows(~first)
