"""Paths to streams of bytes: each file, and each member of the files that are archives."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from descentflow.core.errors import DataError
from descentflow.surveillance.rows.drop_report import DropReport
from descentflow.surveillance.unpacking.archives import is_tar, members
from descentflow.surveillance.unpacking.source_files import with_parts
from descentflow.surveillance.unpacking.streams import Input, opened, unpacked
from descentflow.surveillance.unpacking.unreadable import Unreadable

EMPTY = "empty files (0 bytes) beside others, left out"
"""Note in the report."""


def inputs(files: Sequence[Path], report: DropReport, unreadable: Unreadable) -> Iterator[Input]:
    """Files one after the other, and the members of those that are archives.

    Each must be read before the next is asked for, and is closed then. An empty one of several is left out and counted.

    Args:
        files: What to open; parts of a split archive are read as one.
        report: Takes the counts of files and members left out.
        unreadable: Takes the files that cannot be read.

    Raises:
        DataError: If a file cannot be opened or an archive is damaged.

    Example:
        >>> report = DropReport()
        >>> [source.label for source in inputs([Path("rows.parquet")], report, Unreadable(report))]
        ['rows.parquet']
    """
    sources = with_parts(files)
    for label, parts in sources:
        with opened(parts, label) as source:
            of_tree = len(sources) > 1 and parts[0].name.startswith("trace_full_")
            source = replace(source, one_of_many=of_tree)
            try:
                head, whole = unpacked(source).head()
            except DataError as error:
                unreadable.count(error, source)
                continue
            if not head and len(sources) > 1:
                report.note(EMPTY, 1)
                continue
            if is_tar(head):
                yield from members(whole, report)
            else:
                yield whole
