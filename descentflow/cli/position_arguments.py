"""Options for the place of descents: an end point and a track or a route, and a wind."""

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from descentflow.positions.ground_plan import GroundPlan


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that lay descents over the ground."""
    group = parser.add_argument_group(
        "positions",
        "Every table has the distance flown and the distance to go (NM), the distance from the top of descent to the "
        "end point (NM) and the groundspeed (kt). With an end point and a track, or with a route, it has latitude, "
        "longitude and track too: descents are laid back from the end point.",
    )
    group.add_argument(
        "--end",
        type=_point,
        metavar="LAT,LON",
        help="point where descents end, a threshold or a fix: 51.47,-0.45; or -33.95,151.18, also as 33.95S,151.18E",
    )
    group.add_argument("--track", type=float, metavar="DEG", help="true track on which they arrive there")
    group.add_argument(
        "--route",
        type=_point,
        nargs="+",
        metavar="LAT,LON",
        help="in place of both, fixes in the order in which they are flown; the last one is the end point",
    )
    group.add_argument(
        "--to-go",
        type=float,
        default=0.0,
        metavar="NM",
        help="distance left to the end point where the model's lowest level is passed (default: 0)",
    )
    group.add_argument(
        "--wind",
        help="FROM/KT as 270/35, by flight level as 100:250/20,300:270/60, or a NetCDF or GRIB file of winds on "
        "pressure levels (needs the extra `wind`); still air by default",
    )
    group.add_argument(
        "--time",
        metavar="UTC",
        help="when the lowest level is passed, as 2026-11-22T10:00:00; adds timestamps, and chooses within a file of "
        "winds at several times",
    )


def plan_of(args: argparse.Namespace) -> "GroundPlan":
    """Values of the arguments.

    Raises:
        ConfigError: If they contradict each other.
        DataError: If a file of winds cannot be read.
    """
    from descentflow.positions.ground_plan import ground_plan

    return ground_plan(
        end=args.end,
        track=args.track,
        route=args.route,
        wind=args.wind,
        to_go_nm=args.to_go,
        end_time=args.time,
    )


def _point(text: str) -> tuple[float, float]:
    """LAT,LON in degrees, with a sign or with a letter."""
    try:
        latitude, longitude = (part.strip() for part in text.split(","))
        return _degrees(latitude, "NS"), _degrees(longitude, "EW")
    except ValueError as error:
        expected = "LAT,LON in degrees, as 51.47,-0.45 or 33.95S,151.18E"
        raise argparse.ArgumentTypeError(f"{text!r}; expected {expected}") from error


def _degrees(text: str, letters: str) -> float:
    if text[-1:].upper() in tuple(letters):
        return float(text[:-1]) * (-1 if text[-1].upper() == letters[1] else 1)
    return float(text)
