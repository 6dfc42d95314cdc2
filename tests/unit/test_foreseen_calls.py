"""Answers worked out before they are asked for: the same in whatever order, and none left over."""

import os
import signal
import sys
import time
from multiprocessing import active_children

import pytest

from descentflow.core.foreseen_calls import ForeseenCalls
from descentflow.core.side_by_side import Begun, at_once, cores_shared

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="copies of a process are made on Linux alone"),
    pytest.mark.usefixtures("two_threads"),
]


def unwanted() -> tuple[int, int]:
    raise AssertionError("what was begun is worked out anew")


def here() -> tuple[int, int]:
    return 0, os.getpid()


def answer(number: int) -> tuple[int, int]:
    """Twice the number, and by which process; none below zero, and of large ones only after a minute."""
    if number < 0:
        raise ValueError(f"{number} is below zero")
    time.sleep(60 if number >= 1000 else number / 1000)
    return 2 * number, os.getpid()


needs_two_cores = pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core works out one call at a time")


@needs_two_cores
def test_what_was_foreseen_is_worked_out_in_copies_the_most_probable_first() -> None:
    begun: list[object] = []
    with cores_shared(), ForeseenCalls(answer, begun.append) as calls:
        calls.foresee({k: k for k in range(4)})
        assert begun == [0, 1]  # as many as cores
        found = [calls.ask(k, unwanted) for k in (1, 0)]  # in another order than they were begun
        assert [twice for twice, _ in found] == [2, 0]
        assert os.getpid() not in {pid for _, pid in found}
        assert calls.ask(2, unwanted)[0] == 4  # begun while the others were waited for
    assert begun[:3] == [0, 1, 2]


@needs_two_cores
def test_whoever_has_answered_answers_again() -> None:
    with cores_shared(), ForeseenCalls(answer, lambda key: None) as calls:
        pids = set()
        for first in range(0, 20, 2):
            calls.foresee({k: k for k in (first, first + 1)})
            pids |= {calls.ask(k, unwanted)[1] for k in (first, first + 1)}
        assert len(pids) <= 2
    assert active_children() == []


def test_what_was_not_begun_is_worked_out_here() -> None:
    with cores_shared(), ForeseenCalls(answer, lambda key: None) as calls:
        calls.foresee({k: 500 + k for k in range(9)})
        assert calls.ask("other", here)[1] == os.getpid()
        assert calls.ask(8, here)[1] == os.getpid()


def test_nothing_is_begun_where_one_may_run_at_a_time() -> None:
    begun: list[object] = []
    with ForeseenCalls(answer, begun.append) as calls:
        calls.foresee({"a": 1})
        assert begun == []
        assert calls.ask("a", here)[1] == os.getpid()
    assert begun == ["a"]


@needs_two_cores
def test_a_core_that_is_left_free_meanwhile_is_used_at_once() -> None:
    copies: dict[object, int] = {}
    with (
        cores_shared(),
        Begun(lambda: time.sleep(0.2), own_core=True) as beside,
        ForeseenCalls(answer, lambda key: copies.update({key: at_once()})) as calls,
    ):
        calls.foresee({k: k for k in (700, 701)})
        assert copies == {}  # the call beside has the one core, and this process the other
        assert calls.ask(700, unwanted)[1] != os.getpid()
        assert copies == {700: 1, 701: 2}
        assert calls.ask(701, unwanted)[0] == 1402
        beside.result()
    assert active_children() == []


@needs_two_cores
def test_what_is_wanted_no_more_is_ended_and_makes_room() -> None:
    with cores_shared(), ForeseenCalls(answer, lambda key: None) as calls:
        calls.foresee(dict.fromkeys(range(2), 1000))
        calls.foresee({"wanted": 1})
        assert calls.ask("wanted", unwanted)[1] != os.getpid()
        calls.foresee(dict.fromkeys(range(2), 1000))
    assert active_children() == []


@needs_two_cores
def test_an_error_is_raised_where_its_answer_is_asked_for() -> None:
    with cores_shared(), ForeseenCalls(answer, lambda key: None) as calls:
        calls.foresee({"bad": -1, "good": 500})
        assert calls.ask("good", unwanted)[0] == 1000  # the other failed meanwhile
        with pytest.raises(ValueError, match="below zero"):
            calls.ask("bad", lambda: answer(-1))
        calls.foresee({"bad": -1})
        with pytest.raises(ValueError, match="below zero"):
            calls.ask("bad", lambda: answer(-1))
    assert active_children() == []


@needs_two_cores
def test_a_worker_that_was_killed_is_told() -> None:
    with cores_shared(), ForeseenCalls(answer, lambda key: None) as calls:
        calls.foresee({"slow": 900})
        os.kill(active_children()[0].pid or 0, signal.SIGKILL)
        with pytest.raises(MemoryError, match="lack of memory"):
            calls.ask("slow", unwanted)
    assert active_children() == []
