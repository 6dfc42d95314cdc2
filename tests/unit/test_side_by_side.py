"""Calls worked out side by side: the same results as one by one, and no silence when one of them fails."""

import os
import signal
import sys
import threading
import time
from multiprocessing import active_children

import pytest
import torch

from descentflow.core.side_by_side import Begun, at_once, cores_shared, is_shared, side_by_side
from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
from descentflow.diagnosis.inference.example_sides import example_likelihood
from descentflow.diagnosis.inference.fits_ahead import FitsAhead
from descentflow.diagnosis.inference.free_discrepancy import FreeDiscrepancy
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.selection import Chosen, select
from descentflow.effects import EFFECTS

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="copies of a process are made on Linux alone"),
    pytest.mark.usefixtures("two_threads"),
]


def test_calls_run_in_other_processes_with_one_thread_each() -> None:
    with cores_shared():
        assert at_once() == min(2, len(os.sched_getaffinity(0)))
        found = side_by_side([lambda: (os.getpid(), torch.get_num_threads(), at_once())] * 3)
    if len(os.sched_getaffinity(0)) > 1:
        assert os.getpid() not in {pid for pid, _, _ in found}
    assert {(threads, allowed) for _, threads, allowed in found} == {(1, 1)}
    assert torch.get_num_threads() == 2
    assert at_once() == 1


def test_results_come_in_the_order_of_the_calls() -> None:
    def slowly(k: int) -> torch.Tensor:
        time.sleep(0.05 * (3 - k))
        return torch.full((1000,), float(k))

    begun: list[int] = []
    with cores_shared():
        found = side_by_side([lambda k=k: slowly(k) for k in range(4)], begun.append)  # type: ignore[misc]
    assert [float(values.mean()) for values in found] == [0.0, 1.0, 2.0, 3.0]
    assert begun == [0, 1, 2, 3]


def test_an_error_is_raised_here() -> None:
    def fails() -> int:
        raise ValueError("no such thing")

    with cores_shared(), pytest.raises(ValueError, match="no such thing"):
        side_by_side([lambda: 1, fails, lambda: 2])


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: [0])(0)) < 2, reason="one core: nothing is begun")
def test_a_killed_copy_is_told() -> None:
    with cores_shared(), pytest.raises(MemoryError, match="status -9"):
        side_by_side([lambda: os.kill(os.getpid(), signal.SIGKILL), lambda: None])


def test_calls_follow_each_other_beside_other_threads() -> None:
    found: list[int] = []

    def work() -> None:
        with cores_shared():
            found.extend(side_by_side([os.getpid, os.getpid]))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [os.getpid()] * 2


def test_what_is_begun_and_never_asked_for_leaves_no_process(capfd: pytest.CaptureFixture[str]) -> None:
    with cores_shared(), pytest.raises(KeyboardInterrupt), Begun(lambda: time.sleep(60)) as begun:
        raise KeyboardInterrupt
    assert begun.pipe is None or begun.pipe.closed
    assert active_children() == []
    assert capfd.readouterr().err == ""


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: [0])(0)) < 2, reason="one core: nothing is begun")
def test_a_long_call_has_a_core_while_it_works() -> None:
    with cores_shared():
        with Begun(lambda: time.sleep(0.3)):
            assert at_once() == 2
        with Begun(lambda: time.sleep(0.3), own_core=True) as begun:
            assert is_shared()
            assert at_once() == 1
            assert side_by_side([os.getpid] * 2) == [os.getpid()] * 2
            begun.result()
            assert at_once() == 2
        with Begun(at_once, own_core=True) as other:
            assert other.result() == 1
        assert at_once() == 2


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: [0])(0)) < 2, reason="one core: nothing is begun")
def test_a_call_that_is_held_takes_no_core_and_knows_what_was_known_when_it_was_made() -> None:
    known = ["before"]
    with cores_shared(), Begun(lambda: (list(known), at_once()), own_core=True, held=True) as begun:
        known.append("after")
        assert begun.is_held
        assert at_once() == 2
        begun.start()
        assert not begun.is_held
        assert begun.result() == (["before"], 1)


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: [0])(0)) < 2, reason="one core: nothing is begun")
def test_a_call_that_is_held_begins_when_it_is_asked_for() -> None:
    with cores_shared(), Begun(os.getpid, held=True) as begun:
        assert begun.result() != os.getpid()
    with cores_shared(), Begun(lambda: 1, held=True):
        pass
    assert active_children() == []


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: [0])(0)) < 2, reason="one core: nothing is begun")
def test_what_is_asked_for_late_comes_after_the_others() -> None:
    usual = os.nice(0)
    with cores_shared(), Begun(lambda: os.nice(0)) as begun, Begun(lambda: os.nice(0), gives_way=True) as late:
        assert usual == begun.result() < late.result()
    assert os.nice(0) == usual


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: [0])(0)) < 2, reason="one core: nothing is begun")
def test_a_core_is_free_once_its_call_is_done_though_nobody_asked_yet() -> None:
    # More than a pipe holds: the copy could not end before it is received.
    with cores_shared(), Begun(lambda: b"x" * 10**7, own_core=True) as begun:
        until = time.monotonic() + 30
        while at_once() < 2 and time.monotonic() < until:
            time.sleep(0.01)
        assert at_once() == 2
        assert len(begun.result()) == 10**7


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: [0])(0)) < 2, reason="one core: nothing is begun")
def test_what_follows_a_fit_is_worked_out_where_the_fit_was() -> None:
    likelihood = example_likelihood(EFFECTS["temperature"], [10.0])
    free = FreeDiscrepancy(likelihood, discrepancy_columns(likelihood.compared))
    start = {name: EFFECTS[name].start() for name in ("temperature", "mass")}
    one = (("temperature",), {"temperature": start["temperature"]})
    begun: list[str] = []
    with (
        cores_shared(),
        FitsAhead(likelihood, free, begun.append, lambda fit: ("temperature",)) as ahead,
    ):
        ahead.foresee([(("temperature", "mass"), start)], start)
        ahead.fit(("temperature", "mass"), start)
        found = ahead.fit(*one)
        assert begun == ["fitting temperature, mass"]
        ahead.fit(("mass",), {"mass": start["mass"]})
    assert begun[1:] == ["fitting mass"]
    alone = fit_effects(likelihood, *one)
    assert torch.equal(found.theta["temperature"], alone.theta["temperature"])
    assert torch.equal(found.log_score, alone.log_score)


def test_a_result_that_nobody_wants_any_more_is_no_error(capfd: pytest.CaptureFixture[str]) -> None:
    with cores_shared():
        begun = Begun(lambda: time.sleep(0.2) or b"x" * 10**6)
        if begun.pipe is not None:
            begun.pipe.close()
    for child in active_children():
        child.join(10)
        assert child.exitcode == 0
    assert capfd.readouterr().err == ""


def test_a_selection_is_the_same_on_one_core_and_on_two() -> None:
    likelihood = example_likelihood(EFFECTS["speed_brake"], [0.4, 200, 240, 1, 0, 0, 0, 0])
    columns = discrepancy_columns(likelihood.compared)

    def chosen() -> Chosen:
        return select(likelihood, columns, lambda stage: None)

    torch.set_num_threads(1)
    alone = chosen()
    torch.set_num_threads(2)
    with cores_shared():
        together = chosen()
    assert together.fit.effects == alone.fit.effects
    for name, theta in alone.fit.theta.items():
        torch.testing.assert_close(together.fit.theta[name], theta, rtol=0, atol=0)
    assert together.probability == alone.probability
    assert [one.effects for one in together.sets] == [one.effects for one in alone.sets]
