"""A run's files: its folder, its best checkpoint, its settings, and the scores of its held-out flights."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.settings_file import read_settings

SETTINGS = "config.yaml"
SCORED = "test"
"""Folder in a run that `descentflow test` writes to."""
PAGE = "run.html"


@dataclass(frozen=True)
class Run:
    """A run of `descentflow fit`.

    Attributes:
        folder: With ``config.yaml``.
        checkpoint: Of the best epoch.
        settings: What ``config.yaml`` says.

    Example:
        >>> run = Run(Path("runs/flow/version_0"), Path("runs/flow/version_0/checkpoints/best.ckpt"), {})
        >>> run.page.name, run.scored.name, run.is_scored
        ('run.html', 'test', False)
    """

    folder: Path
    checkpoint: Path
    settings: dict[str, Any]

    @property
    def page(self) -> Path:
        """Where the run's page is written."""
        return self.folder / PAGE

    @property
    def scored(self) -> Path:
        """Where the scores of its held-out flights are."""
        return self.folder / SCORED

    @property
    def is_scored(self) -> bool:
        """Whether there are scores of this checkpoint, and not of one that was there before it."""
        scores = self.scored / "scores.csv"
        return scores.is_file() and scores.stat().st_mtime_ns >= self.checkpoint.stat().st_mtime_ns

    @property
    def descents(self) -> list[Path]:
        """Descents that it was trained on, as the settings name them; some may be gone.

        Example:
            >>> Run(Path("runs"), Path("best.ckpt"), {"data": {"descents": "a.parquet"}}).descents
            [PosixPath('a.parquet')]
        """
        named = (self.settings.get("data") or {}).get("descents")
        several = named if isinstance(named, list) else [named]
        return [Path(one) for one in several if isinstance(one, str)]


def find_run(path: str | Path) -> Run:
    """The run of a folder, or of a checkpoint in it.

    Args:
        path: Folder with ``config.yaml`` and ``checkpoints/best.ckpt``, or a checkpoint.

    Raises:
        ConfigError: If it is neither.
        DataError: If there is no such file or folder.

    Example:
        >>> find_run("descents.parquet")
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: no run at descents.parquet; expected a folder with config.yaml and ...
    """
    given = Path(path)
    if not given.exists():
        raise DataError(f"no file or folder {given}", expected="a run of `descentflow fit`", mend="correct the path")
    folders = [given, given.parent] if given.is_dir() else [given.parent, given.parent.parent]
    folder = next((one for one in folders if (one / SETTINGS).is_file()), None)
    checkpoint = given if given.suffix == ".ckpt" else None if folder is None else folder / "checkpoints" / "best.ckpt"
    if folder is None or checkpoint is None or not checkpoint.is_file():
        raise ConfigError(
            f"no run at {given}",
            expected=f"a folder with {SETTINGS} and checkpoints/best.ckpt, or the checkpoint in it",
            mend="pass the folder that `descentflow fit` wrote, runs/NAME/version_N",
        )
    return Run(folder, checkpoint, read_settings(folder / SETTINGS))
