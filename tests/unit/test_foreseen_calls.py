"""Calls worked out before they are asked for: the same results in whatever order, and none left over."""

import os
import sys
import time
from multiprocessing import active_children

import pytest

from descentflow.core.foreseen_calls import ForeseenCalls
from descentflow.core.side_by_side import cores_shared

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="copies of a process are made on Linux alone"),
    pytest.mark.usefixtures("two_threads"),
]


def unwanted() -> int:
    raise AssertionError("what was begun is worked out anew")


needs_two_cores = pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core works out one call at a time")


@needs_two_cores
def test_what_was_foreseen_is_worked_out_in_copies_the_most_probable_first() -> None:
    begun: list[object] = []
    with cores_shared(), ForeseenCalls(begun.append) as calls:
        calls.foresee({k: lambda k=k: (k, os.getpid()) for k in range(4)})
        assert begun == [0, 1]  # as many as cores
        found = [calls.ask(k, unwanted) for k in (1, 0)]  # in another order than they were begun
        assert [k for k, _ in found] == [1, 0]
        assert os.getpid() not in {pid for _, pid in found}
        assert calls.ask(2, unwanted)[0] == 2  # begun while the others were waited for
    assert begun[:3] == [0, 1, 2]


def test_what_was_not_begun_is_worked_out_here() -> None:
    with cores_shared(), ForeseenCalls(lambda key: None) as calls:
        calls.foresee({k: lambda: os.getpid() for k in range(9)})
        assert calls.ask("other", os.getpid) == os.getpid()
        assert calls.ask(8, os.getpid) == os.getpid()


def test_nothing_is_begun_where_one_may_run_at_a_time() -> None:
    begun: list[object] = []
    with ForeseenCalls(begun.append) as calls:
        calls.foresee({"a": unwanted})
        assert begun == []
        assert calls.ask("a", os.getpid) == os.getpid()
    assert begun == ["a"]


@needs_two_cores
def test_what_is_wanted_no_more_is_ended_and_makes_room() -> None:
    with cores_shared(), ForeseenCalls(lambda key: None) as calls:
        calls.foresee({k: lambda: time.sleep(60) for k in range(2)})
        calls.foresee({"wanted": os.getpid})
        assert calls.ask("wanted", unwanted) != os.getpid()
        calls.foresee({k: lambda: time.sleep(60) for k in range(2)})
    assert active_children() == []


@needs_two_cores
def test_an_error_is_raised_where_its_call_is_asked_for() -> None:
    with cores_shared(), ForeseenCalls(lambda key: None) as calls:
        calls.foresee({"bad": lambda: 1 // 0, "good": lambda: time.sleep(0.5) or 5})
        assert calls.ask("good", unwanted) == 5  # the other failed meanwhile
        with pytest.raises(ZeroDivisionError):
            calls.ask("bad", lambda: 1 // 0)
        calls.foresee({"bad": lambda: 1 // 0})
        with pytest.raises(ZeroDivisionError):
            calls.ask("bad", lambda: 1 // 0)
    assert active_children() == []
