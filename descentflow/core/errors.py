"""Typed errors: each message has what was got, what was expected and how to mend it."""

import sys
import warnings
from collections.abc import Iterable
from difflib import get_close_matches

MAX_PART_CHARACTERS = 4000
"""Characters of a part of a message: values of a damaged file can be a million long."""


def shortened(text: str) -> str:
    """A text without its middle where it is too long to be read.

    Example:
        >>> len(shortened("x" * 10**6)) < 5000, shortened("as it is")
        (True, 'as it is')
    """
    if len(text) <= MAX_PART_CHARACTERS:
        return text
    half = MAX_PART_CHARACTERS // 2
    return f"{text[:half]} ... ({len(text) - 2 * half:,} characters left out) ... {text[-half:]}"


def nearest(word: str, names: Iterable[str]) -> str:
    """The name that a mistyped word is nearest to; empty if it is near none.

    Example:
        >>> nearest("prepar", ["prepare", "predict"]), nearest("xyz", ["prepare"])
        ('prepare', '')
    """
    return next(iter(get_close_matches(word, list(names), n=1)), "")


class DescentflowError(Exception):
    """Base of every error that descentflow raises on purpose; the command line prints it without a trace."""

    def __init__(self, got: str, *, expected: str, mend: str) -> None:
        """Build the message from its three parts.

        Args:
            got: What was found, with the file and place where that helps.
            expected: What would have been accepted.
            mend: What the user can do about it.

        Example:
            >>> raise DataError("rows.csv has no column 'IAS'", expected="columns timestamp, ...",
            ...                 mend="rename the airspeed column to IAS (knots)")
            Traceback (most recent call last):
            ...
            descentflow.core.errors.DataError: rows.csv has no column 'IAS'; expected columns timestamp, ...; \
to mend it, rename the airspeed column to IAS (knots)
        """
        self.got, self.expected, self.mend = shortened(got), shortened(expected), shortened(mend)
        super().__init__(f"{self.got}; expected {self.expected}; to mend it, {self.mend}")

    def __reduce__(self) -> tuple[object, ...]:
        """As another process raises it: made of its message and what it names, whatever its arguments were."""
        return _made_again, (type(self), str(self)), self.__dict__


def _made_again(kind: "type[DescentflowError]", message: str) -> "DescentflowError":
    return kind.__new__(kind, message)


class DescentflowWarning(UserWarning):
    """Warning that a user should see although the work goes on; the command line prints it in one line."""


def warn(text: str) -> None:
    """Warn at the line outside of the package from which it was called.

    Example:
        >>> with warnings.catch_warnings(record=True) as seen:
        ...     warnings.simplefilter("always", DescentflowWarning)
        ...     warn("these descents do not say how they were cleaned")
        >>> print(seen[0].message)
        these descents do not say how they were cleaned
    """
    level, frame = 2, sys._getframe(1)
    while frame.f_back and str(frame.f_globals.get("__name__", "")).startswith("descentflow."):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, DescentflowWarning, stacklevel=level)


class DataError(DescentflowError):
    """Surveillance rows or prepared descents that cannot be used.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> read_descents("no_such.parquet")
        Traceback (most recent call last):
        descentflow.core.errors.DataError: ...no_such.parquet...; expected ...; to mend it, ...
    """


class NoRowsError(DataError):
    """Files without any row: an error of all of them together, and counted where they are some of many.

    Example:
        >>> import descentflow as df
        >>> import polars as pl
        >>> df.prepare(pl.DataFrame(schema=dict.fromkeys(("timestamp", "icao24", "altitude", "IAS"), pl.String)))
        Traceback (most recent call last):
        descentflow.core.errors.NoRowsError: no row in ...; expected surveillance rows; to mend it, ...
    """


class CleaningError(DataError):
    """Rows of which cleaning leaves nothing, or refuses all: of all files together, none of which it names.

    Example:
        >>> import descentflow as df
        >>> df.prepare("rows.parquet", bottom_fl=400)
        Traceback (most recent call last):
        descentflow.core.errors.CleaningError: no free descent is left: ...; expected ...; to mend it, ...
    """


class AircraftError(DescentflowError):
    """Aircraft coefficients that are missing, unreadable or out of range.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> aircraft("A320", "no_such_folder")
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: BADA directory no_such_folder; expected ...; to mend it, ...
    """


class UnknownTypeError(AircraftError):
    """A type without coefficients, where those of other types can be read.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> aircraft("A399")
        Traceback (most recent call last):
        descentflow.core.errors.UnknownTypeError: ...A399...; expected ...; to mend it, ...
    """


class CheckpointError(DescentflowError):
    """A checkpoint that is truncated, of another version or not written by descentflow.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> load_model("rows.parquet")
        Traceback (most recent call last):
        descentflow.core.errors.CheckpointError: rows.parquet...; expected ...; to mend it, ...
    """


class SamplingError(DescentflowError):
    """A draw budget spent before enough plausible descents were found.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.generation.rejection import sample_descents
        >>> model = load_model("best.ckpt")
        >>> parts = model.representation
        >>> sample_descents(model, parts, n=100, seed=0, draw_budget=10)
        Traceback (most recent call last):
        descentflow.core.errors.SamplingError: only ...; expected 100 plausible descents within 10 draws; to ...
    """


class ImplausibleError(SamplingError):
    """A constraint that no descent of the model meets, with a near value that some do.

    Attributes:
        constraint: Name of what cannot be met, for instance ``cas_kt``.
        nearest: The nearest value, in the unit of the name, of 1,000 plausible draws that meet everything else.

    Example:
        >>> import descentflow as df
        >>> try:
        ...     df.Generator("best.ckpt").next(entry_fl=330, cas_kt={200: 180})
        ... except ImplausibleError as error:
        ...     error.constraint, 220 < error.nearest < 300
        ('cas_kt', True)
    """

    def __init__(self, got: str, *, expected: str, mend: str, constraint: str, nearest: float) -> None:
        """Build the message, and keep what it names."""
        super().__init__(got, expected=expected, mend=mend)
        self.constraint, self.nearest = constraint, nearest


class ConfigError(DescentflowError):
    """Settings that contradict each other or the data.

    Example:
        >>> from descentflow.diagnosis.diagnose import diagnose
        >>> diagnose("descents.parquet", "A320", channels=["callsign"])
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: channel 'callsign'; expected some of ...; to mend it, correct it
    """


def check_utf8(words: Iterable[str]) -> None:
    """Refuse bytes that are no UTF-8: libraries that read and write files take names in UTF-8 only."""
    for word in words:
        if not word.isascii() and any("\ud800" <= letter <= "\udfff" for letter in word):
            raise ConfigError(
                f"the word {word!a}",
                expected="words and names of files in UTF-8",
                mend="set the environment variable PYTHONUTF8=1 if the locale lacks such letters, else rename the file",
            )
