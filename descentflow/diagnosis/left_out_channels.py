"""Channels that one side lacks, with the effects that they would have separated."""

from collections.abc import Mapping

from descentflow.diagnosis.findings.inputs_found import LeftOutChannel
from descentflow.effects import Effect


def left_out_channels(lacked: Mapping[str, str], catalogue: Mapping[str, Effect]) -> list[LeftOutChannel]:
    """Channels left out on both sides because one lacks them.

    Args:
        lacked: Channel -> the side that lacks it.
        catalogue: Effects that may be named: each names the channels it needs, and which tell it from others.

    Example:
        >>> from descentflow.effects import EFFECTS
        >>> left_out_channels({"geoaltitude": "real"}, EFFECTS)[0].would_have_told_apart
        ['temperature']
    """
    return [
        LeftOutChannel(channel, side, [n for n, e in catalogue.items() if channel in (*e.needs, *e.splits)])
        for channel, side in lacked.items()
    ]
