"""Typed errors: each message says what was got, what was expected and how to mend it."""


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
        self.got, self.expected, self.mend = got, expected, mend
        super().__init__(f"{got}; expected {expected}; to mend it, {mend}")


class DescentflowWarning(UserWarning):
    """What a user should know although the work goes on; the command line prints it in one line."""


class DataError(DescentflowError):
    """Surveillance rows or prepared descents that cannot be used."""


class AircraftError(DescentflowError):
    """Aircraft coefficients that are missing, unreadable or out of range."""


class CheckpointError(DescentflowError):
    """A checkpoint that is truncated, of another version or not written by descentflow."""


class SamplingError(DescentflowError):
    """A draw budget spent before enough plausible descents were found."""


class ConfigError(DescentflowError):
    """Settings that contradict each other or the data."""
