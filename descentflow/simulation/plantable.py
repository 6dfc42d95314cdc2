"""Causes that can be planted in flights, with their values, units, defaults and bounds.

It stands apart from what the causes do, for a command's help lists it without loading what flies.
"""

from collections.abc import Mapping

from descentflow.simulation.cause_values import CauseValue, Plantable, Values, completed

WAVE_ONSET = 0.06
"""Compressibility drag begins this far below the planned Mach number."""
_SHARE = CauseValue("share", "1", 0.8, "share of the flights", 0.0, 1.0)
_OF_FLIGHTS = CauseValue("of_flights", "1", 1.0, "share of the flights that have it", 0.0, 1.0)
_OF_IDLE_RANGE = CauseValue("of_idle_range", "1", 0.0, "each flight's own share of idle, uniform about it", 0.0, 0.4)


def _factor_values(default: float, low: float, high: float) -> tuple[CauseValue, ...]:
    return (
        CauseValue("factor", "1", default, "mean factor", low, high),
        CauseValue("spread", "1", 0.0, "standard deviation of the factor between flights", 0.0, 1.0),
        CauseValue("share", "1", 1.0, "share of the flights that have it", 0.0, 1.0),
    )


def _within_idle(v: Values) -> str | None:
    return None if v["of_idle"] + v["of_idle_range"] <= 1 else "of_idle and of_idle_range together at most 1"


PLANTABLE: dict[str, Plantable] = {
    "temperature": Plantable(
        "air warmer or colder than the standard atmosphere at all heights",
        (
            CauseValue("deviation_k", "K", 10.0, "mean deviation", -60.0, 60.0),
            CauseValue("spread_k", "K", 0.0, "standard deviation between flights", 0.0, 20.0),
            CauseValue("daily_spread_k", "K", 0.0, "standard deviation between days", 0.0, 20.0),
        ),
    ),
    "wind_gradient": Plantable(
        "an along-track tailwind that grows with height",
        (
            CauseValue("slope_kt_per_kft", "kt/1000 ft", 2.0, "mean growth", -10.0, 10.0),
            CauseValue("spread_kt_per_kft", "kt/1000 ft", 0.0, "standard deviation between flights", 0.0, 5.0),
            CauseValue("daily_spread_kt_per_kft", "kt/1000 ft", 0.0, "standard deviation between days", 0.0, 5.0),
        ),
    ),
    "mass": Plantable(
        "flights heavier or lighter",
        _factor_values(0.9, 0.5, 1.5),
    ),
    "idle_thrust": Plantable(
        "more or less idle thrust",
        _factor_values(1.8, 0.0, 10.0),
    ),
    "drag_polar": Plantable(
        "more or less parasitic drag of the airframe (CD0)",
        _factor_values(1.1, 0.5, 2.0),
    ),
    "speed_brake": Plantable(
        "speed brakes between two levels on a share of the flights",
        (
            CauseValue("factor", "1", 1.6, "factor of CD0 with brakes out", 1.0, 4.0),
            CauseValue("share", "1", 0.6, "share of the flights", 0.0, 1.0),
            CauseValue("low_fl", "FL", 230.0, "lower end", 0.0, 600.0),
            CauseValue("high_fl", "FL", 280.0, "upper end", 0.0, 600.0),
            CauseValue("spread_fl", "FL", 0.0, "standard deviation of each flight's levels", 0.0, 100.0),
            CauseValue(
                "depth_spread", "1", 0.0, "relative standard deviation of each flight's height of window", 0.0, 0.5
            ),
            CauseValue(
                "strength_spread", "1", 0.0, "relative standard deviation of each flight's drag added", 0.0, 0.5
            ),
        ),
        lambda v: None if v["low_fl"] < v["high_fl"] else "low_fl below high_fl",
    ),
    "geometric_path": Plantable(
        "a path angle over the ground held all the way down by a share of the flights",
        (
            _SHARE,
            CauseValue("of_idle", "1", 0.9, "angle held, in units of the flight's shallowest at idle thrust", 0.5, 1.0),
            _OF_IDLE_RANGE,
        ),
        _within_idle,
    ),
    "vertical_speed_mode": Plantable(
        "a rate of descent held over a part of the descent by a share of the flights",
        (
            _SHARE,
            CauseValue("of_idle", "1", 0.88, "rate held, in units of the flight's slowest at idle thrust", 0.5, 1.0),
            CauseValue("depth_fl", "FL", 90.0, "height over which it is held", 20.0, 250.0),
            _OF_IDLE_RANGE,
            CauseValue("depth_range_fl", "FL", 0.0, "each flight's own height, uniform about it", 0.0, 100.0),
        ),
        lambda v: _within_idle(v) or (None if v["depth_range_fl"] < v["depth_fl"] else "depth_range_fl below depth_fl"),
    ),
    "level_off": Plantable(
        "a level-off in a share of the flights that have none",
        (
            CauseValue("share", "1", 0.6, "share of the flights", 0.0, 1.0),
            CauseValue("duration_s", "s", 100.0, "how long it lasts", 5.0, 1800.0),
            CauseValue("duration_range_s", "s", 0.0, "each flight's own, uniform about it", 0.0, 600.0),
        ),
        lambda v: None if v["duration_range_s"] < v["duration_s"] else "duration_range_s below duration_s",
    ),
    "speed_schedule": Plantable(
        "descents planned faster or slower",
        (
            CauseValue("cas_kt", "kt", -20.0, "more CAS below the crossover", -100.0, 100.0),
            CauseValue("mach", "1", -0.02, "more Mach number above it", -0.2, 0.2),
            CauseValue("spread_kt", "kt", 0.0, "standard deviation of the CAS between flights", 0.0, 20.0),
            CauseValue("share", "1", 1.0, "share of the flights", 0.0, 1.0),
        ),
    ),
    "airspeed_bias": Plantable(
        "IAS off by a bias that grows with Mach number",
        (
            CauseValue("bias_kt", "kt", 2.0, "error at M 0.6", -30.0, 30.0),
            CauseValue("slope_kt_per_mach", "kt", 25.0, "growth of the error for one Mach", -200.0, 200.0),
            CauseValue("spread_kt", "kt", 0.0, "standard deviation between airframes", 0.0, 10.0),
        ),
    ),
    "vertical_rate_lag": Plantable(
        "the reported rate is late",
        (
            CauseValue("lag_s", "s", 12.0, "more in the time constant of the reported rate", 0.0, 120.0),
            CauseValue("spread_s", "s", 0.0, "standard deviation between airframes", 0.0, 30.0),
        ),
    ),
    "measurement_noise": Plantable(
        "noisier reports of all fields",
        (CauseValue("factor", "1", 3.0, "factor of every standard deviation", 0.0, 20.0),),
    ),
    "compressibility": Plantable(
        "wave drag near M_MO, which no BADA 3 polar has",
        (
            CauseValue("gain", "1", 0.2, "of CD0 at the planned Mach number", 0.0, 2.0),
            CauseValue("onset_below", "1", WAVE_ONSET, "how far below the planned Mach number it begins", 0.01, 0.3),
        ),
    ),
    "kept_thrust": Plantable(
        "thrust kept up after the top of descent, decaying",
        (
            CauseValue("share", "1", 0.4, "of drag minus idle thrust at the top", 0.0, 1.0),
            CauseValue("decay_s", "s", 150.0, "time constant of its decay", 10.0, 3000.0),
            CauseValue("share_range", "1", 0.0, "each flight's own share, uniform about it", 0.0, 0.5),
            CauseValue("decay_range_s", "s", 0.0, "each flight's own decay, uniform about it", 0.0, 1000.0),
            _OF_FLIGHTS,
        ),
        lambda v: (
            None if v["share_range"] <= v["share"] and v["decay_range_s"] < v["decay_s"] else "ranges within the values"
        ),
    ),
    "turn": Plantable(
        "a turn at a height of each flight's own",
        (
            CauseValue("bank_deg", "deg", 30.0, "bank", 0.0, 60.0),
            CauseValue("share", "1", 0.8, "share of the flights", 0.0, 1.0),
            CauseValue("depth_fl", "FL", 40.0, "height over which they turn", 5.0, 150.0),
        ),
    ),
    "anti_ice": Plantable(
        "engines kept up for anti-ice between two levels of each flight's own",
        (
            CauseValue("share", "1", 0.7, "share of the flights", 0.0, 1.0),
            CauseValue("drag_share", "1", 0.4, "thrust above idle, of drag minus idle thrust", 0.0, 1.0),
            CauseValue("low_fl", "FL", 220.0, "lower end", 0.0, 600.0),
            CauseValue("high_fl", "FL", 270.0, "upper end", 0.0, 600.0),
            CauseValue("spread_fl", "FL", 0.0, "standard deviation of each flight's levels", 0.0, 100.0),
        ),
        lambda v: None if v["low_fl"] < v["high_fl"] else "low_fl below high_fl",
    ),
    "induced_drag": Plantable(
        "more or less induced drag of the airframe (CD2)",
        (CauseValue("factor", "1", 1.1, "factor of CD2", 0.5, 2.0),),
    ),
    "powered_descent": Plantable(
        "thrust above idle all the way down",
        (
            CauseValue("share", "1", 0.18, "of drag minus idle thrust", 0.0, 1.0),
            CauseValue("share_range", "1", 0.0, "each flight's own share, uniform about it", 0.0, 0.5),
            _OF_FLIGHTS,
        ),
        lambda v: None if v["share_range"] <= v["share"] else "share_range at most share",
    ),
}
"""By the name of the cause: first those of the diagnosis's catalogue, then those outside it."""


def complete(causes: Mapping[str, Values]) -> dict[str, dict[str, float]]:
    """Values of causes with the defaults of those that are left out.

    Args:
        causes: Values by the name of the cause.

    Raises:
        ConfigError: If there is no such cause or value, or a value cannot be flown.

    Example:
        >>> complete({"temperature": {"deviation_k": 3.0}})
        {'temperature': {'deviation_k': 3.0, 'spread_k': 0.0, 'daily_spread_k': 0.0}}
    """
    return {name: completed(name, PLANTABLE, values) for name, values in causes.items()}
