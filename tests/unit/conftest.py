"""Components of equal profiles are fitted once for all unit tests, but for those of what fits them."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def fitted_components(request: pytest.FixtureRequest) -> None:
    """A fit that a test asks for is made at least once in a session, with the very profiles and options asked for."""
    if "fpca" not in request.module.__name__:
        request.getfixturevalue("components_once")
