"""Distances and places against closed forms and great circles."""

from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
import pytest
import torch
from position_toys import steady_descents
from pyproj import Geod

from descentflow.core.errors import ConfigError
from descentflow.core.units import KT_MPS, NM_M
from descentflow.positions.ground_path import path_along, path_to
from descentflow.positions.ground_plan import ground_plan
from descentflow.positions.placing import place
from descentflow.positions.wind import WindByLevel, wind_of_text

WGS84 = Geod(ellps="WGS84")
DESCENT_S = 200 * 30.48 / 10


def test_constant_speed_in_still_air() -> None:
    """Speed over the ground is V cos(gamma); a sum of exact trapezia, so to rounding."""
    placed = place(steady_descents([200.0, 230.0]))
    expected = np.sqrt(np.array([200.0, 230.0]) ** 2 - 100.0) * DESCENT_S
    np.testing.assert_allclose(placed.distance_m[:, 0], expected, rtol=1e-12)
    np.testing.assert_allclose(placed.to_go_m[:, -1], expected, rtol=1e-12)
    np.testing.assert_allclose(placed.top_of_descent_m, expected, rtol=1e-12)
    assert (placed.to_go_m[:, 0] == 0).all()
    assert (placed.distance_m[:, -1] == 0).all()


def test_distance_is_counted_from_the_entry_and_to_go_from_the_end_point() -> None:
    placed = place(steady_descents([200.0], entry=100), to_go_m=5000.0)
    half = np.sqrt(200.0**2 - 100.0) * DESCENT_S / 2
    np.testing.assert_allclose(placed.distance_m[0, [0, 100]], [half, 0.0], atol=1e-6)
    np.testing.assert_allclose(placed.to_go_m[0, [0, 100]], [5000.0, 5000.0 + half])
    np.testing.assert_allclose(placed.top_of_descent_m, [5000.0 + half])


@pytest.mark.parametrize(("direction", "along", "across"), [(270, 25.0, 0.0), (90, -25.0, 0.0), (0, 0.0, 25.0)])
def test_constant_wind_along_the_equator(direction: int, along: float, across: float) -> None:
    """The equator is a geodesic of constant track, so the wind triangle holds all along it."""
    wind = wind_of_text(f"{direction}/{25 / KT_MPS}")
    placed = place(steady_descents([200.0]), path_to((0.0, 10.0), track=90.0), wind)
    groundspeed = np.sqrt(200.0**2 - 100.0 - across**2) + along
    np.testing.assert_allclose(placed.groundspeed_mps, groundspeed, rtol=1e-9)
    np.testing.assert_allclose(placed.top_of_descent_m, groundspeed * DESCENT_S, rtol=1e-9)
    # A degree of the equator of WGS84 is 2 pi a / 360.
    degrees = placed.top_of_descent_m / (2 * np.pi * 6378137.0 / 360)
    np.testing.assert_allclose(placed.longitude[:, -1], 10.0 - degrees, rtol=1e-9)


def test_wind_that_grows_with_height() -> None:
    """At a constant rate the mean of a linear profile is its value in the middle; no track change on the equator."""
    wind = WindByLevel(np.array([150.0, 350.0]), np.array([10.0, 50.0]), np.zeros(2))
    placed = place(steady_descents([200.0]), path_to((0.0, 0.0), track=90.0), wind)
    still = np.sqrt(200.0**2 - 100.0)
    np.testing.assert_allclose(placed.top_of_descent_m, (still + 30.0) * DESCENT_S, rtol=1e-9)
    np.testing.assert_allclose(placed.groundspeed_mps[0, [0, 50, 200]], still + np.array([10.0, 20.0, 50.0]))


@pytest.mark.parametrize("wind", [None, "310/45"])
def test_places_lie_on_the_great_circle_at_the_distance_to_go(wind: str | None) -> None:
    """A millimetre: what pyproj's inverse and direct problems differ by."""
    end = (51.47, -0.45)
    placed = ground_plan(end=end, track=271.0, wind=wind).place(steady_descents([180.0, 240.0]))
    shape = placed.latitude.shape
    ends = np.full(shape, end[1]), np.full(shape, end[0])
    _, back, distance = WGS84.inv(placed.longitude, placed.latitude, *ends)
    np.testing.assert_allclose(distance, placed.to_go_m, atol=1e-3)
    far = placed.to_go_m > 1000
    np.testing.assert_allclose((back[far] + 180) % 360, 271.0, atol=1e-6)
    towards, _, _ = WGS84.inv(placed.longitude, placed.latitude, *ends)
    np.testing.assert_allclose(towards[far] % 360, placed.track[far], atol=1e-6)


def test_a_wind_turns_the_integration_with_the_track() -> None:
    """Far from the end a track of 90 degrees was another: compared with steps of a twentieth of a level."""
    fine = steady_descents([220.0])
    levels = torch.linspace(150, 350, 4001, dtype=torch.float64)
    time = (350 - levels)[None] * 30.48 / 10
    flat = torch.full((1, 4001), 220.0, dtype=torch.float64)
    finer = type(fine)(levels, torch.tensor([4000]), time, flat, flat, flat, flat * 0 - 10.0, flat)
    plan = ground_plan(end=(68.0, 20.0), track=90.0, wind="150:200/30,350:160/110")
    coarse, exact = plan.place(fine).to_go_m[:, -1], plan.place(finer).to_go_m[:, -1]
    np.testing.assert_allclose(coarse, exact, atol=0.1)
    assert abs(exact - ground_plan(end=(68.0, 20.0), track=90.0).place(fine).to_go_m[:, -1]) > 500


def test_a_route_is_flown_from_fix_to_fix() -> None:
    fixes = [(51.0, 3.0), (51.6, 3.4), (51.5, 4.4), (51.9, 4.45)]
    path = path_along(fixes)
    legs = [WGS84.inv(a[1], a[0], b[1], b[0])[2] for a, b in pairwise(fixes)]
    for left, (latitude, longitude) in zip([0.0, legs[2], legs[2] + legs[1], sum(legs)], fixes[::-1], strict=True):
        position = path.at(np.array([left]))
        np.testing.assert_allclose([position[0][0], position[1][0]], [latitude, longitude], atol=1e-9)
    before = path.at(np.array([sum(legs) + 10_000.0]))
    assert WGS84.inv(before[1][0], before[0][0], 3.0, 51.0)[2] == pytest.approx(10_000.0, abs=1e-3)
    on_first = WGS84.inv(3.0, 51.0, 3.4, 51.6)[0]
    assert before[2][0] == pytest.approx(on_first, abs=0.2)


def test_times_count_back_from_the_lowest_level() -> None:
    end = datetime(2026, 11, 22, 10, tzinfo=UTC)
    placed = ground_plan(end_time="2026-11-22T10:00:00").place(steady_descents([200.0]))
    assert placed.unix_s[0, 0] == end.timestamp()
    assert placed.unix_s[0, -1] == pytest.approx(end.timestamp() - DESCENT_S)


def test_wind_is_read_as_aviation_writes_it() -> None:
    here = np.zeros(1)
    east, north = wind_of_text("225/20").at(300.0, here, here, None)
    np.testing.assert_allclose([east[0], north[0]], np.array([1, 1]) * 20 * KT_MPS / np.sqrt(2))
    wind = wind_of_text("100:180/10,300:270/30")
    np.testing.assert_allclose(np.ravel(wind.at(50.0, here, here, None)), [0, 10 * KT_MPS], atol=1e-12)
    np.testing.assert_allclose(np.ravel(wind.at(200.0, here, here, None)), np.array([15, 5]) * KT_MPS, atol=1e-12)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"end": (51.0, 4.0)}, "without a track"),
        ({"track": 90.0}, "a track without an end point"),
        ({"end": (51.0, 4.0), "track": 90.0, "route": [(51.0, 4.0), (52.0, 4.0)]}, "an end point and a route"),
        ({"end": (4.0, 510.0), "track": 90.0}, "the point 4,510"),
        ({"end": (51.0, 4.0), "track": 400.0}, "track of 400"),
        ({"route": [(51.0, 4.0)]}, "a route of 1 fix"),
        ({"route": [(51.0, 4.0), (51.0, 4.0)]}, "twice"),
        ({"wind": "270/30"}, "a wind without a direction of flight"),
        ({"end": (51.0, 4.0), "track": 90.0, "wind": "breezy"}, "the wind 'breezy'"),
        ({"end": (51.0, 4.0), "track": 90.0, "wind": "300:270/30,100:270/10"}, "ascending flight levels"),
        ({"end": (51.0, 4.0), "track": 90.0, "wind": "270/30,280/40"}, "ascending flight levels"),
        ({"to_go_nm": -1.0}, "to_go_nm = -1.0; expected a finite number, 0 or more"),
        ({"end_time": "noon"}, "the time 'noon'"),
    ],
)
def test_what_cannot_be_is_refused(said: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ground_plan(**said)


@pytest.mark.parametrize(
    ("track", "wind", "message"),
    [
        (270.0, "270/380", "cannot hold its track.*kt on the command line"),
        (270.0, "0/380", "cannot hold its track"),
        (90.0, "270/400", r"a wind of 400 kt at FL.* up to 389 kt"),
    ],
)
def test_a_wind_that_no_flight_or_no_earth_has_is_refused(track: float, wind: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ground_plan(end=(51.0, 4.0), track=track, wind=wind).place(steady_descents([190.0]))


def test_above_the_entry_a_wind_is_not_asked_for() -> None:
    wind = WindByLevel(np.array([200.0, 300.0]), np.array([0.0, 400.0]), np.zeros(2))
    plan = ground_plan(end=(51.0, 4.0), track=270.0, wind=wind)
    assert np.isfinite(plan.place(steady_descents([200.0], entry=60)).top_of_descent_m).all()
    with pytest.raises(ConfigError):
        plan.place(steady_descents([200.0]))


def test_nautical_miles_and_knots_of_the_tables() -> None:
    from descentflow.generation.sample_tables import to_frame

    table = to_frame(steady_descents([100.0], rate_mps=-5.0), positions=None)
    speed = np.sqrt(100.0**2 - 25.0)
    assert table["groundspeed"].to_numpy() == pytest.approx(speed / KT_MPS)
    assert table["distance_nm"].max() == pytest.approx(speed * 200 * 30.48 / 5 / NM_M)
    assert (table["distance_nm"] + table["distance_to_go_nm"]).to_numpy() == pytest.approx(
        table["top_of_descent_nm"].to_numpy()
    )
    assert "latitude" not in table.columns
