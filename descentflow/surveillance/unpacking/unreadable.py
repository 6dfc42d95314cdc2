"""Files that cannot be read: an error for a single file, a count where there are many."""

from collections.abc import Iterator
from contextlib import contextmanager
from tarfile import TarError

import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.streams import Input


class Unreadable:
    """Counts the unreadable files of one reading, and keeps the first error in case nothing else is found.

    Example:
        >>> import io
        >>> report = DropReport()
        >>> with Unreadable(report).watch(Input(io.BytesIO(), "cut.json", one_of_many=True)):
        ...     raise OSError("damaged")
        >>> report.notes
        {'traces and members of archives that could not be read': 1}
    """

    def __init__(self, report: DropReport) -> None:
        self.first_error: DataError | None = None
        self._report = report

    def count(self, error: DataError, source: Input) -> None:
        """Count a file if it is one of many.

        Raises:
            DataError: The error itself, if it is not.
        """
        if not source.one_of_many:
            raise error
        self.first_error = self.first_error or error
        self._report.note("traces and members of archives that could not be read", 1)

    @contextmanager
    def watch(self, source: Input) -> Iterator[None]:
        """Read a file inside of this: what readers do not foresee becomes a DataError that names it, then is counted.

        Raises:
            DataError: If the file cannot be read and is not one of many.
        """
        try:
            with whole_input(source.label):
                yield
        except DataError as error:
            self.count(error, source)


@contextmanager
def whole_input(label: object, expected: str = "a whole, readable file", mend: str = "copy it again") -> Iterator[None]:
    """Read a file inside of this: what a library does not foresee becomes a DataError that names the file.

    Args:
        label: What the file is called in the message.
        expected: What would have been read.
        mend: What the user can do about it.

    Raises:
        DataError: If the file cannot be read.

    Example:
        >>> with whole_input("cut.parquet"):
        ...     raise OSError("ends in the middle")
        Traceback (most recent call last):
        descentflow.core.errors.DataError: cut.parquet: ends in the middle; expected a whole, readable file; ...
    """
    try:
        yield
    except (pl.exceptions.PolarsError, OSError, TarError) as error:
        raise _damaged(label, error, expected, mend) from error
    except BaseException as error:
        # Polars and the decoder of Mode S panic on some damage; this is no Exception.
        if type(error).__name__ != "PanicException":
            raise
        raise _damaged(label, error, expected, mend) from error


def _damaged(label: object, error: BaseException, expected: str, mend: str) -> DataError:
    reason = (str(error).splitlines() or [type(error).__name__])[0][:300]
    return DataError(f"{label}: {reason}", expected=expected, mend=mend)
