"""Folder of a watch between runs: settings, one line a day, and the last alarm; whole at every instant."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.files import Claim, whole_file

VERSION = 1
SETTINGS, DAYS, ALARM, PAGE, LOCK = "watch.json", "days.parquet", "alarm.json", "watch.html", ".watch.lock"
KEYS = ("day", "file", "file_bytes", "fingerprint")
"""Columns that say where a day came from."""


@dataclass(frozen=True)
class WatchSettings:
    """Settings of a watch, fixed when its folder is made.

    Attributes:
        simulator: Name of what is watched.
        fingerprint: Of its flights or weights; empty for nominal BADA.
        typecode: Type of its coefficients.
        reference_days: First days, between which the scatter is learnt.
        false_alarms: Rate of false alarms a year, over all that is watched.
        since: Day from which days count: the day of the last change that was accepted; all if None.

    Example:
        >>> WatchSettings("flown", "", "A320", 30, 0.05).since is None
        True
    """

    simulator: str
    fingerprint: str
    typecode: str
    reference_days: int
    false_alarms: float
    since: str | None = None


class State:
    """The folder of a watch.

    Example:
        >>> state = State("watched")
        >>> with state.locked():
        ...     _ = state.begin(WatchSettings("flown", "", "A320", 30, 0.05))
        >>> state.settings.reference_days, len(state.days())
        (30, 0)
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder alone.

        Raises:
            DataError: If another run holds it.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        claim = Claim(self.folder / LOCK)
        if not claim.take():
            raise DataError(
                f"{self.folder}, which another watch is writing", expected="one at a time", mend="wait for its end"
            )
        try:
            yield
        finally:
            claim.let_go()

    @property
    def settings(self) -> WatchSettings | None:
        """Settings; None where the folder is new.

        Raises:
            DataError: If the file is none of a watch.
        """
        path = self.folder / SETTINGS
        if not path.exists():
            return None
        content = _read(path)
        if content.pop("version", None) != VERSION:
            raise DataError(f"{path} of another version", expected=f"version {VERSION}", mend="begin a new folder")
        try:
            return WatchSettings(**content)
        except TypeError as error:
            raise DataError(f"{path} ({error})", expected="settings of a watch", mend="begin a new folder") from error

    def begin(self, settings: WatchSettings) -> WatchSettings:
        """Write settings, or check that they are those of the folder.

        Raises:
            ConfigError: If the folder watches another simulator, or by other settings.
        """
        known = self.settings
        if known is None:
            self._write(SETTINGS, {"version": VERSION, **asdict(settings)})
            return settings
        mine, theirs = ({**asdict(one), "since": None} for one in (settings, known))
        other = [f"{name} {theirs[name]} (now {mine[name]})" for name in mine if mine[name] != theirs[name]]
        if other:
            raise ConfigError(
                f"{self.folder}, which was begun with {', '.join(other)}",
                expected="the simulator and the settings that it was begun with",
                mend="give those, or another folder",
            )
        return known

    def days(self) -> pl.DataFrame:
        """One line for each day, in the order of days."""
        path = self.folder / DAYS
        return pl.read_parquet(path) if path.exists() else pl.DataFrame({name: [] for name in KEYS})

    def add(self, lines: list[dict[str, Any]]) -> None:
        """Write days that are new besides those that are known; the file is whole before and after."""
        if lines:
            new = pl.DataFrame(lines, infer_schema_length=None)
            known = pl.concat([self.days(), new], how="diagonal_relaxed")
            with whole_file(self.folder / DAYS) as temporary:
                known.sort("day").write_parquet(temporary)

    def alarm(self) -> dict[str, Any] | None:
        """The alarm that stands; None where there is none, or it was accepted."""
        path, settings = self.folder / ALARM, self.settings
        alarm = _read(path) if path.exists() else None
        accepted = settings.since if settings else None
        return None if alarm is None or (accepted and alarm["change"]["day"] <= accepted) else alarm

    def keep_alarm(self, alarm: dict[str, Any] | None) -> None:
        """Keep the alarm that stands; None if there is none."""
        if alarm is not None:
            self._write(ALARM, alarm)
        else:
            (self.folder / ALARM).unlink(missing_ok=True)

    def accept(self) -> None:
        """Make the days from the change on a new reference.

        Raises:
            ConfigError: If no alarm stands.
        """
        settings, alarm = self.settings, self.alarm()
        if settings is None or alarm is None:
            raise ConfigError(f"{self.folder} without an alarm", expected="one to accept", mend="leave out --accept")
        # Settings first: after a kill in between, the alarm is of a day that is accepted, and stands no more.
        self._write(SETTINGS, {"version": VERSION, **asdict(settings), "since": alarm["change"]["day"]})
        (self.folder / ALARM).unlink()

    def _write(self, name: str, content: dict[str, Any]) -> None:
        with whole_file(self.folder / name) as temporary:
            temporary.write_text(json.dumps(content, indent=1, allow_nan=False))


def _read(path: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(path.read_text()))
    except (OSError, TypeError, ValueError) as error:
        raise DataError(f"{path}: {error}", expected="a file of a watch", mend="begin a new folder") from error
