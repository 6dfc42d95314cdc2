"""Components of equal profiles are fitted once for all unit tests, but for those of what fits them; two threads."""

from collections.abc import Iterator

import pytest
import torch


@pytest.fixture(scope="module", autouse=True)
def fitted_components(request: pytest.FixtureRequest) -> None:
    """A fit that a test asks for is made at least once in a session, with the very profiles and options asked for."""
    if "fpca" not in request.module.__name__:
        request.getfixturevalue("components_once")


@pytest.fixture
def two_threads() -> Iterator[None]:
    """Two threads of torch, whatever the test process has: as many calls may run side by side."""
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)
