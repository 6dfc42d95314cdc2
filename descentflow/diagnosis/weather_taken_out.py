"""Real flights beside a simulator that knows their air: brought to standard air, as its own flights were."""

import polars as pl

from descentflow.air.standard_air import in_standard_air
from descentflow.core.errors import DataError
from descentflow.representation.own_air import airs_as_kept
from descentflow.representation.representation import Representation


def without_weather(frame: pl.DataFrame, parts: Representation) -> tuple[pl.DataFrame, int]:
    """Real flights in standard air, and how many were left out because they do not report their air.

    The training flights that a checkpoint carries were brought there likewise, each by its own temperature and wind:
    the comparison is the one of the simulator flown in the real flights' own airs.

    Args:
        frame: Prepared descents.
        parts: Of a model; of drag in standard air, nothing is changed.

    Raises:
        ConfigError: If the model's air came from a weather file.
        DataError: If no flight reports its air.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> frame = pl.read_parquet("descents.parquet")
        >>> without_weather(frame, load_representation("best.ckpt"))[1]
        0
    """
    if parts.air is None:
        return frame, 0
    levels_fl = parts.decoder.levels_fl.cpu()
    airs = airs_as_kept(frame, levels_fl, parts.air)
    found = in_standard_air(frame, parts.decoder.aircraft, airs, levels_fl)
    if found.is_empty():
        raise DataError(
            f"none of {airs.without} flights reports its air",
            expected="flights with TAS and groundspeed, for a model of drag in measured air",
            mend="give such flights, or diagnose a model that was fitted with data.air=standard",
        )
    return found, airs.without
