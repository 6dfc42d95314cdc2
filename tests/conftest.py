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


@pytest.fixture(scope="module", autouse=True)
def kept(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Profiles that a test fitted keep their components, and worlds are flown once, but in the tests of these."""
    from kept_by_workers import folder_of_workers
    from kept_components import keep_components
    from kept_worlds import keep_worlds

    with pytest.MonkeyPatch.context() as patch:
        if "fpca" not in request.module.__name__:
            keep_components(patch, folder_of_workers(tmp_path_factory, "components"))
        if "simulation" not in request.module.__name__:
            keep_worlds(patch, folder_of_workers(tmp_path_factory, "worlds"))
        yield


@pytest.fixture(scope="module")
def plain_figures() -> Iterator[None]:
    """Evaluations write empty figures, for to draw them is a third of a run: for files that look at none.

    The figures have tests of their own (``tests/unit/test_evaluation_figures.py``).
    """
    from matplotlib.figure import Figure

    from descentflow.evaluation.evaluation_report import Evaluation

    names = ("profiles", "cuts", "distance_by_level", "rejections", "components")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Evaluation, "drawn", Evaluation.figures, raising=False)
        patch.setattr(Evaluation, "figures", lambda _: {name: Figure(figsize=(1, 1)) for name in names})
        yield


@pytest.fixture
def real_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """The real ones again, for one test."""
    from descentflow.evaluation.evaluation_report import Evaluation

    monkeypatch.setattr(Evaluation, "figures", Evaluation.drawn)


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
