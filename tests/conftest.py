"""Fixtures shared by all tests."""

from pathlib import Path

import pytest
import torch

# Small matrices gain nothing from threads, and lose tenfold to them where several runs share the cores.
torch.set_num_threads(1)


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the reference material that is kept beside the repository and not inside it."""
    folder = Path(__file__).resolve().parents[2] / "shared"
    if not folder.is_dir():
        pytest.skip("reference material (../shared beside the repository) is not on this machine")
    return folder
