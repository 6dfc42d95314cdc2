"""Scores of the rivals' answers, and meanings of their names; their libraries are not needed."""

import pytest
import torch

from benchmarks.rivals_mapping import EFFECTS_OF_NODE
from benchmarks.rivals_sbi import posterior_answer
from benchmarks.rivals_scoring import Answer, Scored, tally

RATE = EFFECTS_OF_NODE["rate"]


def scored(kind: str, effects: set[str], *named: frozenset[str], **more: object) -> Scored:
    answer = Answer(named, **{"gap": bool(named), **more})
    return Scored("set", kind, frozenset(effects), answer, 2.0)


@pytest.mark.parametrize(
    ("one", "cause", "exact"),
    [
        (scored("null", set()), "right", None),
        (scored("null", set(), RATE), "wrong", None),
        (scored("single", {"mass"}, RATE), "right", True),
        (scored("single", {"mass"}, frozenset({"temperature"}), RATE), "wrong", False),
        (scored("single", {"mass"}), "none", False),
        (scored("single", {"mass"}, unknown=True), "none", False),
        (scored("double", {"mass", "temperature"}, RATE, frozenset({"temperature"})), "right", True),
        (scored("outside", {"kept_thrust"}, unknown=True), "right", None),
        (scored("outside", {"kept_thrust"}, RATE, unknown=True), "wrong", None),
        (scored("outside", {"kept_thrust"}), "none", None),
        (scored("single", {"mass"}, gap=True, says_causes=False), None, None),
    ],
)
def test_an_answer_is_right_wrong_or_none(one: Scored, cause: str | None, exact: bool | None) -> None:
    assert (one.cause, one.exact) == (cause, exact)


def test_tally_counts_each_answer_once_and_says_what_is_left_open() -> None:
    some = [scored("single", {"mass"}, RATE), scored("single", {"mass"}, frozenset({"wind_gradient"}))]
    some += [scored("single", {"mass"}), scored("single", {"mass"}, gap=None)]
    found = tally(some)
    assert (found.n, found.right, found.wrong, found.none) == (4, 1, 1, 2)
    assert (found.gaps, found.says_gaps) == (2, 3)  # one did not say whether there is a gap
    assert (found.left_open, found.seconds) == (4.0, 2.0)  # seven effects of one name, one of the other


def test_npe_names_what_its_interval_says_is_not_zero() -> None:
    """Means of 4, 8 and 1 spreads; at 0.05 over three effects the interval is 2.4 spreads wide to either side."""
    draws = torch.randn(20_000, 3, generator=torch.Generator().manual_seed(1)) + torch.tensor([4.0, -8.0, 1.0])
    names, least = ["mass", "temperature", "wind_gradient"], torch.tensor([0.5, 0.5, 0.5])
    answer = posterior_answer(names, draws, least)
    assert answer.named == (frozenset({"temperature"}), frozenset({"mass"}))
    assert posterior_answer(["mass"], torch.rand(5000, 1), torch.tensor([0.5])).gap is False  # above zero, but small
