"""Work of the sealed study spread over processes."""

from pathlib import Path

import pytest

from studies.blind_diagnosis import processes


def test_more_work_than_processes_are_kept_for_is_all_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All processes of a share end at the same time; the study of 980 files stood still after the first fifty."""
    monkeypatch.setattr(processes, "TASKS_PER_PROCESS", 2)
    files, counted = [tmp_path / str(k) for k in range(9)], []
    processes.spread([(Path.touch, file) for file in files], 2, counted.append)
    assert all(file.exists() for file in files)
    assert counted == list(range(1, 10))
