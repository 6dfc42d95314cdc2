"""Refusals of calls, a line each."""

from collections.abc import Callable

import pytest


def refuses(error: type[Exception], words: str, call: Callable[..., object], *args: object, **options: object) -> None:
    """Fail unless the call ends in this error, in whose message the pattern is found."""
    with pytest.raises(error, match=words):
        call(*args, **options)
