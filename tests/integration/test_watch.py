"""A watch over a simulated fleet whose drag changes: alarm, date, cause; late, doubled and damaged days."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from pathlib import Path

import polars as pl
import pytest

from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.diagnosis.diagnose import diagnose
from descentflow.effects import EFFECTS
from descentflow.simulation.days import simulate_days
from descentflow.watching.state import DAYS
from descentflow.watching.watch import watch

CHANGED = "2024-03-17"
REFERENCE = 8


@pytest.fixture(scope="module", autouse=True)
def few_effects() -> Iterator[None]:
    """Causes that are sought quickly: their search has tests of its own."""
    few = {name: EFFECTS[name] for name in ("drag_polar", "temperature")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(import_module("descentflow.watching.watch"), "diagnose", partial(diagnose, catalogue=few))
        yield


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Days of some 12 flights; from a date on the aircraft have a third more drag."""
    folder = tmp_path_factory.mktemp("watch") / "days"
    simulate_days("A320", 240, 20, folder, seed=5, changes={CHANGED: {"drag_polar": {"factor": 1.4}}})
    return folder


@pytest.fixture(scope="module")
def state(fleet: Path) -> Path:
    """The state after all days came at once."""
    found = watch("A320", fleet, state=fleet.parent / "state", reference_days=REFERENCE)
    assert found.is_new
    return fleet.parent / "state"


def test_files_hold_a_day_each_and_flights_before_the_change_are_as_without_it(fleet: Path) -> None:
    first = pl.read_parquet(sorted(fleet.iterdir())[2])
    began = first.group_by("icao24", "callsign").agg(pl.col("timestamp").min().dt.date())
    assert began["timestamp"].n_unique() == 1


def test_the_change_is_found_dated_sized_and_explained(state: Path) -> None:
    alarm = json.loads((state / "alarm.json").read_text())
    assert alarm["raised"] > CHANGED
    assert alarm["change"]["earliest"] <= CHANGED <= alarm["change"]["latest"]
    assert alarm["shown_by"][0]["quantity"] == "rate"
    assert alarm["size"]["time_at_speed (s)"] < -30.0
    assert "drag_polar" in alarm["cause"]["effects"]
    assert not alarm["cause"]["only_the_weather"]
    page = (state / "watch.html").read_text()
    assert "An alarm since" in page
    assert "What cannot be seen" in page


def test_days_one_by_one_in_another_order_give_the_same_state(fleet: Path, state: Path, tmp_path: Path) -> None:
    folder = tmp_path / "some"
    folder.mkdir()
    files = sorted(fleet.iterdir())
    for part in (files[1::2], files[::2]):
        for path in part:
            shutil.copy(path, folder)
        watch("A320", folder, state=tmp_path / "state", reference_days=REFERENCE)
    assert (tmp_path / "state" / DAYS).read_bytes() == (state / DAYS).read_bytes()
    assert (tmp_path / "state" / "alarm.json").read_text() == (state / "alarm.json").read_text()


def test_nothing_new_says_nothing_and_an_alarm_is_new_once(
    fleet: Path, state: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(state, tmp_path / "state")
    words = ["watch", "A320", str(fleet), "--state", str(tmp_path / "state"), "--reference-days", str(REFERENCE)]
    assert main(words) == 0
    (tmp_path / "state" / "alarm.json").unlink()
    assert main(words) == 3
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "an alarm since" in printed.err


def test_days_that_come_again_are_of_another_type_or_damaged_are_left_out_by_name(
    fleet: Path, state: Path, tmp_path: Path
) -> None:
    shutil.copytree(state, tmp_path / "state")
    folder = tmp_path / "more"
    folder.mkdir()
    day = sorted(fleet.iterdir())[5]
    rows = pl.read_parquet(day)
    rows.write_parquet(folder / "again.parquet")
    rows.head(len(rows) // 2).write_parquet(folder / "half.parquet")
    rows.with_columns(typecode=pl.lit("B738")).write_parquet(folder / "other.parquet")
    (folder / "damaged.parquet").write_bytes(day.read_bytes()[:2000])
    before = (tmp_path / "state" / DAYS).read_bytes()
    found = watch("A320", folder, state=tmp_path / "state", reference_days=REFERENCE)
    files = {name.rpartition(" of ")[2] for name in found.left_out}
    assert files == {"half.parquet", "other.parquet", "damaged.parquet"}
    assert (tmp_path / "state" / DAYS).read_bytes() == before


def test_an_accepted_change_is_the_new_reference(fleet: Path, state: Path, tmp_path: Path) -> None:
    shutil.copytree(state, tmp_path / "state")
    found = watch("A320", fleet, state=tmp_path / "state", reference_days=REFERENCE, accept=True)
    assert found.alarm is None
    assert found.settings.since is not None
    with pytest.raises(ConfigError, match="without an alarm"):
        watch("A320", fleet, state=tmp_path / "state", reference_days=REFERENCE, accept=True)


def test_another_simulator_needs_another_folder(fleet: Path, state: Path) -> None:
    with pytest.raises(ConfigError, match="reference_days"):
        watch("A320", fleet.parent / "days", state=state, reference_days=REFERENCE + 1).settings  # noqa: B018


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "days").mkdir()
    with pytest.raises(DataError, match="no day"):
        watch("A320", tmp_path / "days", state=tmp_path / "state")


def test_partitions_have_files_of_one_name(fleet: Path, tmp_path: Path) -> None:
    for path in sorted(fleet.iterdir())[5:7]:
        (tmp_path / "days" / f"day={path.stem}").mkdir(parents=True)
        shutil.copy(path, tmp_path / "days" / f"day={path.stem}" / "part-0.parquet")
    found = watch("A320", tmp_path / "days", state=tmp_path / "state", reference_days=REFERENCE)
    assert found.days["file"].n_unique() == len(found.new_days) == 2


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a file system needs root")
def test_a_disk_that_is_full_for_the_page_keeps_the_days_and_the_next_run_ends_as_undisturbed(
    fleet: Path, state: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "disk"
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", folder], check=False).returncode:
        pytest.skip("no file system may be mounted here")
    try:
        with pytest.raises(DataError, match=r"watch.html cannot be written: No space left on device"):
            watch("A320", fleet, state=folder, reference_days=REFERENCE)
        assert (folder / DAYS).read_bytes() == (state / DAYS).read_bytes()
        subprocess.run(["mount", "-o", "remount,size=8m", folder], check=True)
        watch("A320", fleet, state=folder, reference_days=REFERENCE)
        names = [DAYS, "alarm.json", "watch.html", "watch.json"]
        assert [(folder / name).read_bytes() == (state / name).read_bytes() for name in names] == 4 * [True]
    finally:
        subprocess.run(["umount", folder], check=True)


@pytest.mark.slow  # three processes that import everything
def test_of_two_watches_at_once_one_is_refused_and_the_state_is_that_of_one(fleet: Path, tmp_path: Path) -> None:
    days = tmp_path / "days"
    days.mkdir()
    for path in sorted(fleet.iterdir())[1:5]:
        shutil.copy(path, days)
    states = [tmp_path / "alone", tmp_path / "together", tmp_path / "together"]
    runs = []
    for place in states:
        words = [sys.executable, "-m", "descentflow", "watch", "A320", days, "--state", place]
        runs.append(subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True))
        if place == states[0]:
            runs[0].wait(600)
    said = [run.communicate(timeout=600)[1] for run in runs]
    assert 0 in {run.returncode for run in runs[1:]}, said
    assert all(not run.returncode or "another watch is writing" in text for run, text in zip(runs, said, strict=True))
    assert (states[1] / DAYS).read_bytes() == (states[0] / DAYS).read_bytes()
