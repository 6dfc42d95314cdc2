"""Real flights beside a simulator that knows their air: brought to standard air, as its own flights were."""

import polars as pl

from descentflow.air.standard_air import in_standard_air
from descentflow.core.errors import DataError
from descentflow.representation.own_air import AirSource, airs_as_kept, check_air_asked
from descentflow.representation.representation import Representation


def without_weather(
    frame: pl.DataFrame, parts: Representation, air: AirSource | None = None
) -> tuple[pl.DataFrame, int]:
    """Real flights in standard air, and how many were left out because nothing is known of their air.

    The training flights that a checkpoint carries were brought there likewise, each by its own temperature and wind:
    the comparison is the one of the simulator flown in the real flights' own airs.

    Args:
        frame: Prepared descents.
        parts: Of a model; of drag in standard air, nothing is changed.
        air: Where the flights' air is known from, see :func:`~descentflow.representation.own_air.airs_as_kept`.

    Raises:
        ConfigError: If the model's air came from a weather field and none is given, or one is given to a model of drag
            in standard air.
        DataError: If nothing is known of the air of any flight.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> frame = pl.read_parquet("descents.parquet")
        >>> without_weather(frame, load_representation("best.ckpt"))[1]
        0
    """
    check_air_asked(parts, air)
    if parts.air is None:
        return frame, 0
    levels_fl = parts.decoder.levels_fl.cpu()
    airs = airs_as_kept(frame, levels_fl, parts.air, air)
    found = in_standard_air(frame, parts.decoder.aircraft, airs, levels_fl)
    if found.is_empty():
        raise DataError(
            f"none of {airs.without} flights reports its air",
            expected="flights with TAS and groundspeed, for a model of drag in measured air",
            mend="give such flights, or diagnose a model that was fitted with data.air=standard",
        )
    return found, airs.without
