"""Flights that a model has seen, recognised by aircraft and time: the same rows may come under another flight_id."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.core.errors import CheckpointError
from descentflow.core.row_runs import batches

N_MARKS = 5
"""Levels of a flight whose times are kept: its highest, its lowest, and some between, so that other thresholds of the
cleaning, which cut flights at their ends, leave some."""
SAME_S = 3.0
"""Times at one level up to which two records are of one flight: whole seconds and thinned rows move them by a second or
two. A simulator that flies a flight again is soon further off."""
HEX = re.compile(r"(0x)?[0-9a-f]{1,6}")
DECIMAL = re.compile(r"[0-9]{7,8}")
OTHER = 1 << 61
"""Addresses that are none of 24 bits are numbered from here on, by their text."""
PARTS = ("train", "validation")


@dataclass(frozen=True)
class SeenFlights:
    """Times at which the aircraft of n training and validation flights passed some of their levels.

    Attributes:
        address: (n,) 24-bit addresses, or numbers of other texts, see :func:`address_number`.
        part: (n,) 0 of training flights, 1 of validation flights.
        level_fl: (n, 5) levels.
        time_s: (n, 5) when they passed these, seconds since 1970 in UTC.

    Example:
        >>> frame = pl.read_parquet("descents.parquet")
        >>> first, second, *_ = frame["flight_id"].unique().sort()
        >>> kept = SeenFlights.of(frame, train=[first], validation=[second])
        >>> renamed = frame.with_columns(flight_id="other-" + pl.col("flight_id"))
        >>> kept.among(renamed) == {f"other-{first}": "train", f"other-{second}": "validation"}
        True
    """

    address: Tensor
    part: Tensor
    level_fl: Tensor
    time_s: Tensor

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.address)

    @classmethod
    def of(cls, descents: pl.DataFrame, train: Sequence[str], validation: Sequence[str]) -> "SeenFlights":
        """Of some flights of prepared descents; those without an address are left out.

        Args:
            descents: Prepared descents.
            train: Identifiers of those that trained the model.
            validation: Identifiers of those that validated it.
        """
        parts = [*(0 for _ in train), *(1 for _ in validation)]
        kinds = {"flight_id": pl.String, "part": pl.Int64}
        names = pl.DataFrame({"flight_id": [*train, *validation], "part": parts}, schema=kinds)
        # Some flights at a time: a year of flights has more rows than a copy should be made of.
        marked = [
            _passed(some).group_by("flight_id").agg(pl.col("icao24").first(), *_marks("level_fl"), *_marks("passed_s"))
            for some in batches(descents.select("flight_id", "icao24", "level_fl", "timestamp"), "flight_id")
        ]
        flights = pl.concat(marked)
        flights = flights.join(names, on="flight_id").join(_addresses(flights["icao24"]), on="icao24").sort("flight_id")
        return cls(
            torch.from_numpy(flights["address"].to_numpy().copy()),
            torch.from_numpy(flights["part"].to_numpy().copy()),
            _of_marks(flights, "level_fl").long(),
            _of_marks(flights, "passed_s").double(),
        )

    def among(self, descents: pl.DataFrame) -> dict[str, str]:
        """Flights of prepared descents that are some of these, under whatever name, each with its part.

        A flight is one of these if its aircraft has the same address and passed most of the levels that both have at
        the same time.

        Args:
            descents: Prepared descents.
        """
        marks = pl.DataFrame(
            {
                "seen": np.repeat(np.arange(len(self)), N_MARKS),
                "address": np.repeat(self.address.numpy(), N_MARKS),
                "level_fl": self.level_fl.numpy().ravel(),
                "time_s": self.time_s.numpy().ravel(),
            }
        )
        rows = _passed(descents)
        # Few flights are of the same aircraft, so that most rows need not be looked at.
        same = _addresses(rows["icao24"]).join(marks, on="address", how="semi")
        rows = rows.join(same, on="icao24").join(marks, on=["address", "level_fl"], how="semi")
        met = marks.sort("time_s").join_asof(
            rows.sort("passed_s"),
            left_on="time_s",
            right_on="passed_s",
            by=["address", "level_fl"],
            strategy="nearest",
            tolerance=SAME_S,
            check_sortedness=False,
        )
        agreed = met.drop_nulls("flight_id").group_by("seen", "flight_id").len("agreed")
        levels = rows.select("flight_id", "level_fl").unique()
        common = agreed.join(marks.select("seen", "level_fl"), on="seen").join(levels, on=["flight_id", "level_fl"])
        compared = common.group_by("seen", "flight_id").agg(pl.col("agreed").first(), pl.len().alias("common"))
        same = compared.filter(2 * pl.col("agreed") > pl.col("common")).sort("seen")
        parts = self.part.tolist()
        return {name: PARTS[parts[row]] for name, row in same.select("flight_id", "seen").iter_rows()}

    def training_days(self) -> tuple[str | None, str | None]:
        """Days (ISO 8601, UTC) of the first and of the last training flight; None where there is none."""
        times = self.time_s[self.part == 0]
        if not len(times):
            return None, None
        ends = (float(times.min()), float(times.max()))
        first, last = (datetime.fromtimestamp(end, UTC).date().isoformat() for end in ends)
        return first, last

    def training_aircraft(self) -> int | None:
        """Number of aircraft that flew the training flights; None where no flight is known."""
        return len(set(self.address[self.part == 0].tolist())) or None

    def to_state(self) -> dict[str, Tensor]:
        """Tensors for a checkpoint."""
        return {name: getattr(self, name) for name in ("address", "part", "level_fl", "time_s")}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "SeenFlights":
        """Rebuild from :meth:`to_state`.

        Raises:
            CheckpointError: If it is not what :meth:`to_state` gives.
        """
        address, part, level, time = (_tensor(state, name) for name in ("address", "part", "level_fl", "time_s"))
        shape = (len(address), N_MARKS) if address.dim() else ()
        whole = (
            (address.dtype, part.dtype, level.dtype) == (torch.int64,) * 3
            and time.dtype == torch.float64
            and address.dim() == 1
            and part.shape == address.shape
            and level.shape == time.shape == shape
            and bool(((part == 0) | (part == 1)).all())
            and bool(time.isfinite().all())
        )
        if not whole:
            raise _wrong(
                f"tensors of shapes {', '.join(str(tuple(one.shape)) for one in (address, part, level, time))}"
            )
        return cls(address, part, level, time)


NO_FLIGHTS = SeenFlights(
    torch.zeros(0, dtype=torch.long),
    torch.zeros(0, dtype=torch.long),
    torch.zeros(0, N_MARKS, dtype=torch.long),
    torch.zeros(0, N_MARKS, dtype=torch.float64),
)
"""Of models that were fitted to none."""


def address_number(text: str) -> int:
    """A number for an aircraft's address: the same for every spelling of a 24-bit one.

    Args:
        text: Six hexadecimal digits, also without leading zeros or after ``0x``; seven or eight decimal digits, which
            no hexadecimal address has; or any other text.

    Example:
        >>> [address_number(text) for text in ("00801A", "801a", "0x00801a", "16323968")]
        [32794, 32794, 32794, 16323968]
        >>> address_number("ghost") == address_number("host")
        False
    """
    name = text.strip(" ~").lower()
    if HEX.fullmatch(name):
        return int(name.removeprefix("0x"), 16)
    if DECIMAL.fullmatch(name):
        return int(name)
    return OTHER + int.from_bytes(hashlib.blake2b(name.encode(), digest_size=7).digest())


def _marks(name: str) -> list[pl.Expr]:
    """Values of a flight's column at its marks, from the highest level to the lowest, in columns of their own."""
    falling = pl.col(name).sort_by("level_fl", descending=True)
    places = [((pl.len() - 1) * share).round().cast(pl.Int64) for share in np.linspace(0.0, 1.0, N_MARKS).tolist()]
    return [falling.get(place).alias(f"{name}_{k}") for k, place in enumerate(places)]


def _of_marks(flights: pl.DataFrame, name: str) -> Tensor:
    """The columns of :func:`_marks` as (n, 5)."""
    return torch.stack([torch.from_numpy(flights[f"{name}_{k}"].to_numpy().copy()) for k in range(N_MARKS)], 1)


def _passed(descents: pl.DataFrame) -> pl.DataFrame:
    """Columns ``flight_id icao24 level_fl passed_s`` of prepared descents, of rows with an address and a time."""
    return descents.select(
        pl.col("flight_id", "icao24").cast(pl.String),
        pl.col("level_fl").cast(pl.Int64),
        (pl.col("timestamp").dt.epoch("us") / 1e6).alias("passed_s"),
    ).drop_nulls()


def _addresses(texts: pl.Series) -> pl.DataFrame:
    """Columns ``icao24 address``: each address as it is spelled, and its number."""
    spelled = texts.unique()
    numbers = [address_number(text) for text in spelled.to_list()]
    return pl.DataFrame({"icao24": spelled, "address": pl.Series(numbers, dtype=pl.Int64)})


def _tensor(state: dict[str, Any], name: str) -> Tensor:
    value = state.get(name)
    if not isinstance(value, Tensor):
        raise _wrong(f"{name} of type {type(value).__name__}")
    return value


def _wrong(got: str) -> CheckpointError:
    return CheckpointError(
        f"flights that were seen, with {got}",
        expected=f"address, part, and {N_MARKS} levels and times of each training and validation flight",
        mend="take the file as `descentflow fit` wrote it, or fit again",
    )
