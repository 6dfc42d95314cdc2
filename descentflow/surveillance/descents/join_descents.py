"""Several prepared files as one set of descents; only those that were cleaned alike belong together."""

from collections.abc import Sequence
from typing import Any

import polars as pl

from descentflow.core.errors import DataError
from descentflow.surveillance.cleaning.kept_settings import differences_in_words, different_settings
from descentflow.surveillance.descents.prepared_descents import Descents, top_levels
from descentflow.surveillance.rows.drop_report import DropReport


def join_descents(parts: Sequence[Descents], names: Sequence[str]) -> Descents:
    """All descents of several prepared files, sorted by flight.

    Their settings are known afterwards if they are known of every part.

    Args:
        parts: Prepared descents, one or more.
        names: What each is called in messages.

    Raises:
        DataError: If they were cleaned with different settings, or a flight is in two of them.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> descents = read_descents("descents.parquet")
        >>> first = Descents(descents.frame.filter(pl.col("flight_id") < "synthetic-060"), descents.metadata)
        >>> rest = Descents(descents.frame.filter(pl.col("flight_id") >= "synthetic-060"), descents.metadata)
        >>> join_descents([rest, first], ["rest", "first"]).frame.equals(descents.frame)
        True
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    for part, name in zip(parts[1:], names[1:], strict=True):
        _check_alike(first, part, names[0], name)
    frame = pl.concat([part.frame for part in parts], how="diagonal").sort("flight_id", maintain_order=True)
    flights = pl.concat([part.frame.select("flight_id").unique() for part in parts])
    if flights["flight_id"].is_duplicated().any():
        twice = flights["flight_id"].filter(flights["flight_id"].is_duplicated())[0]
        raise DataError(
            f"flight {twice} in two of {', '.join(names)}",
            expected="every flight once",
            mend="prepare the rows of all of them together",
        )
    return Descents(frame, _joined_metadata(parts, frame))


def _check_alike(first: Descents, other: Descents, name: str, other_name: str) -> None:
    if first.cleaning is not None and other.cleaning is not None:
        differences = different_settings(first.cleaning, other.cleaning)
    else:
        bottoms = float(first.bottom_fl), float(other.bottom_fl)
        differences = {} if bottoms[0] == bottoms[1] else {"bottom_fl": bottoms}
    if differences:
        words = differences_in_words(differences, f"in {other_name}", f"in {name}")
        raise DataError(
            f"descents of different cleaning settings: {words}",
            expected="descents that were all prepared with the same settings",
            mend="prepare their rows with the same settings",
        )


def _joined_metadata(parts: Sequence[Descents], frame: pl.DataFrame) -> dict[str, Any]:
    metadata = {**parts[0].metadata, "top_fl": top_levels(frame)}
    if any(part.cleaning is None for part in parts):
        metadata.pop("settings", None)
    metadata["inputs"] = [one for part in parts for one in part.metadata.get("inputs", [])]
    reports = [part.metadata.get("report") for part in parts]
    metadata.pop("report", None)
    if all(isinstance(report, dict) for report in reports):
        together = DropReport()
        together.extend([DropReport.from_dict(report) for report in reports if report])
        metadata["report"] = together.as_dict()
    return metadata
