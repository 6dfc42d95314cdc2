"""Values that nobody expects in a cell, a field or an option."""

import math
import random
from typing import Any

LONG_TEXT = 1_000_000
NUMBERS = (0, -1, 1, 1e-300, 1e30, 1e300, -1e30, 2**31, 2**63, 2**64, -(2**63), math.nan, math.inf, -math.inf)
TEXTS = (
    "",
    " ",
    "NaN",
    "null",
    "0",
    "-1",
    "1e999",
    "true",
    "..",
    "/",
    "\0",
    "\ufeff",
    "é",
    "航空",
    "=1+1",
    "<script>",
    "%s%n",
)
TIMES = (
    "0000-01-01T00:00:00Z",
    "0001-01-01T00:00:00Z",
    "1677-09-21T00:12:43Z",
    "1969-12-31T23:59:59Z",
    "9999-12-31T23:59:59.999999Z",
    "10000-01-01T00:00:00Z",
    "2024-02-30T25:61:61Z",
)


def odd_value(rng: random.Random) -> Any:
    """Anything that JSON, YAML or a checkpoint can hold."""
    kind = rng.randrange(8)
    if kind < 3:
        return rng.choice(NUMBERS)
    if kind < 5:
        return rng.choice((*TEXTS, *TIMES))
    if kind == 5:
        return "x" * LONG_TEXT if rng.random() < 0.1 else "x" * 300
    return rng.choice((None, True, False, [], {}, [[]], {"": {}}, [None] * 3, list(range(1000))))


def mutate_tree(tree: Any, rng: random.Random, change: Any = None) -> Any:
    """A copy of nested dictionaries and lists with one entry replaced, removed, doubled or added."""
    places = list(_places(tree))
    if not places:
        return odd_value(rng)
    path = rng.choice(places)
    return _changed(tree, path, rng, change or (lambda old: odd_value(rng)))


def _places(tree: Any, path: tuple[Any, ...] = ()) -> Any:
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list | tuple) else ()
    for key, value in entries:
        yield (*path, key)
        yield from _places(value, (*path, key))


def _changed(tree: Any, path: tuple[Any, ...], rng: random.Random, change: Any) -> Any:
    copy: Any = dict(tree) if isinstance(tree, dict) else list(tree)
    key, rest = path[0], path[1:]
    if rest:
        copy[key] = _changed(copy[key], rest, rng, change)
        return copy
    action = rng.random()
    if action < 0.15:
        del copy[key]
    elif action < 0.25 and isinstance(copy, dict):
        copy[rng.choice(("", "other", "__class__", 0, None))] = copy[key]
    elif action < 0.25:
        copy.insert(key, copy[key])
    else:
        copy[key] = change(copy[key])
    return copy
