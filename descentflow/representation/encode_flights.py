"""Descents as a model sees them: cleaned as its own, on its grid, as standardised weights, with context, in parts."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl
from torch import Tensor

from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.representation.airspeed_error import AirspeedErrors, without_airspeed_error
from descentflow.representation.context import ContextEncoder
from descentflow.representation.context_columns import contexts_of, flight_context, read_context_table, with_context
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.flight_parts import PARTS, Part, parts_of, rest_is_test, with_levels
from descentflow.representation.own_air import AirSource, airs_as_kept, check_air_asked, with_own_air
from descentflow.representation.profiles import Profiles, profiles_from_frame
from descentflow.representation.representation import Representation, Split

Say = Callable[[str], None]
FEW_FLIGHTS = 100
"""Training flights below which a summary calls them few."""


@dataclass(frozen=True)
class EncodedFlights:
    """n flights: profiles on the grid, standardised weights (n, d) and encoded context (n, c).

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> known = load_model("best.ckpt").representation
        >>> flights = encode_flights(pl.read_parquet("descents.parquet"), known)["test"]
        >>> len(flights), len(flights.subset([0, 3]).weights), flights.context.shape[1]
        (24, 2, 0)
    """

    profiles: Profiles
    weights: Tensor
    context: Tensor

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.profiles)

    def subset(self, positions: list[int]) -> "EncodedFlights":
        """The flights at these positions."""
        return EncodedFlights(self.profiles.subset(positions), self.weights[positions], self.context[positions])


def encode_flights(
    descents: pl.DataFrame,
    representation: Representation,
    context_table: str | Path | pl.DataFrame | None = None,
    *,
    air: AirSource | None = None,
    say: Say = lambda _: None,
) -> dict[Part, EncodedFlights]:
    """Encode descents with a model's representation, in parts.

    Flights that the model was trained or validated on keep their part; every other flight is a test flight. They are
    recognised by their identifier, and by aircraft and time where they come under another one.

    Args:
        descents: Prepared descents, a row for each flight and level.
        representation: The model's.
        context_table: Table, or path of a CSV or Parquet table, with ``flight_id`` and columns of context
            that the descents do not have.
        air: Where the flights' air is known from, for a model of drag in its flights' own air, see
            :func:`~descentflow.representation.own_air.airs_as_kept`.
        say: Called with a line for each reason why flights are left out: fewer than two levels on the grid, a context
            that cannot be encoded, or an air of which nothing is known, for a model of drag in measured air.

    Raises:
        DataError: If no flight is on the grid, or the table cannot be read.
        ConfigError: If a column of context is missing, a table is given to a model without context, or an air to one of
            drag in standard air; or if the model's flights' air came from a weather field, and none is given.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> parts = encode_flights(read_descents("descents.parquet").frame, load_model("best.ckpt").representation)
        >>> {part: len(flights) for part, flights in parts.items()}
        {'train': 86, 'validation': 10, 'test': 24}
    """
    encoder, decoder = representation.context, representation.decoder
    table = context_of(descents, list(encoder.names), context_table)
    bottom, top = int(decoder.levels_fl[0]), int(decoder.levels_fl[-1])
    profiles = with_levels(profiles_from_frame(descents, decoder.aircraft, bottom, top), say)
    if errors := AirspeedErrors.of(descents):
        profiles = without_airspeed_error(profiles, decoder.aircraft, errors, range(len(profiles)), say)
    check_air_asked(representation, air)
    if representation.air is not None:
        airs = airs_as_kept(descents, decoder.levels_fl, representation.air, air)
        profiles = with_own_air(profiles, decoder.aircraft, airs, say)
    split = split_by_model(descents, profiles.flight_ids, representation)
    return encode_parts(profiles, split, decoder, table, encoder, say)


def split_by_model(descents: pl.DataFrame, flight_ids: Sequence[str], representation: Representation) -> Split:
    """The split of other flights by a model's: those that it never saw, under whatever identifier, are test flights.

    Args:
        descents: Prepared descents.
        flight_ids: Which of their flights are split.
        representation: The model's.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> known, frame = load_model("best.ckpt").representation, pl.read_parquet("descents.parquet")
        >>> renamed = frame.with_columns(flight_id="other-" + pl.col("flight_id"))
        >>> len(split_by_model(renamed, renamed["flight_id"].unique().to_list(), known).test)
        24
    """
    return rest_is_test(tuple(flight_ids), representation.split, representation.seen.among(descents))


def encode_parts(
    profiles: Profiles,
    split: Split,
    decoder: DescentDecoder,
    table: pl.DataFrame,
    encoder: ContextEncoder,
    say: Say,
) -> dict[Part, EncodedFlights]:
    """Encode flights on a decoder's grid, part by part.

    Args:
        profiles: Flights.
        split: Which flight is in which part.
        decoder: Whose components the weights are of.
        table: Context, one row for each flight.
        encoder: Of the context, without columns for a density without one.
        say: Called with a line for each column of context that some flights lack: they are left out.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> known = load_model("best.ckpt").representation
        >>> low, high = int(known.decoder.levels_fl[0]), int(known.decoder.levels_fl[-1])
        >>> flights = profiles_from_frame(pl.read_parquet("descents.parquet"), known.decoder.aircraft, low, high)
        >>> table = pl.DataFrame({"flight_id": flights.flight_ids})
        >>> parts = encode_parts(flights, known.split, known.decoder, table, known.context, print)
        >>> parts["validation"].weights.shape[0]
        10
    """
    parts = parts_of(with_context(profiles, table, encoder, say), split)
    return {
        part: EncodedFlights(
            parts[part], decoder.encode(parts[part]), contexts_of(parts[part].flight_ids, table, encoder)
        )
        for part in PARTS
    }


def context_of(
    descents: pl.DataFrame, names: list[str], context_table: str | Path | pl.DataFrame | None
) -> pl.DataFrame:
    """Context of every flight before encoding: ``flight_id`` and the named columns; no flight if none is named.

    Raises:
        ConfigError: If there is a table although nothing is named, or a column is nowhere to be found.
        DataError: If the table cannot be read.

    Example:
        >>> context_of(pl.read_parquet("descents.parquet"), ["entry_fl"], None).columns
        ['flight_id', 'entry_fl']
    """
    if names:
        return flight_context(descents, names, read_context_table(context_table))
    if context_table is not None:
        given = "" if isinstance(context_table, pl.DataFrame) else f", {context_table},"
        raise ConfigError(
            f"a table of context{given} for a density without context",
            expected="columns of it in data.context, or a checkpoint that was fitted with some",
            mend="name the columns, or leave the table out",
        )
    return pl.DataFrame(schema={"flight_id": pl.String})


def summary_of(parts: dict[Part, EncodedFlights], representation: Representation) -> str:
    """One line on flights, grid, components and context.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> known = load_model("best.ckpt").representation
        >>> summary_of(encode_flights(pl.read_parquet("descents.parquet"), known), known)
        'flights: 86 train, 10 validation, 24 test; grid FL150-...; components: ... of drag, ... of CAS; few...'
    """
    decoder = representation.decoder
    counts = ", ".join(f"{len(parts[part])} {part}" for part in PARTS)
    few = "; few to train on: a useful generator needs hundreds" if 0 < len(parts["train"]) < FEW_FLIGHTS else ""
    return (
        f"flights: {counts}; grid FL{decoder.levels_fl[0]:.0f}-{decoder.levels_fl[-1]:.0f}; components: {decoder.sizes}"
        + (f"; context: {representation.context.describe()}" if representation.n_context else "")
        + few
    )


def tell_other_types(descents: pl.DataFrame, representation: Representation) -> None:
    """Warn of flights whose type the model does not know: that they descend otherwise is no fault of it.

    Args:
        descents: A table of prepared descents.
        representation: The model's.

    Warns:
        DescentflowWarning: If there are any.

    Example:
        >>> import warnings
        >>> from descentflow.densities.checkpoint import load_model
        >>> others = pl.read_parquet("descents.parquet").with_columns(typecode=pl.lit("B738"))
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always")
        ...     tell_other_types(others, load_model("best.ckpt").representation)
        >>> print(caught[0].message)
        120 flights of B738, and the model was trained on A320: what differs may be the type; leave them out unless...
    """
    known = representation.provenance.get("typecodes") or [representation.decoder.aircraft.typecode]
    flights = descents.group_by("typecode").agg(pl.col("flight_id").n_unique()).sort("flight_id", descending=True)
    others = [f"{n} flights of {name}" for name, n in flights.iter_rows() if name not in known]
    if others:
        warnings.warn(
            f"{', '.join(others[:8])}, and the model was trained on {', '.join(known)}: what differs may be the type; "
            "leave them out unless that is what you ask",
            DescentflowWarning,
            stacklevel=3,
        )
