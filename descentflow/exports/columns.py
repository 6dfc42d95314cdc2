"""Meaning of the columns of samples: units as other formats write them, and names in the CF conventions."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SampleColumn:
    """One column: unit (in the writing of UDUNITS), meaning, and standard name of the CF conventions if there is one.

    Example:
        >>> COLUMNS["CAS"].unit, COLUMNS["TAS"].standard_name
        ('knot', 'platform_speed_wrt_air')
    """

    unit: str
    meaning: str
    standard_name: str | None = None


COLUMNS = {
    "sample_id": SampleColumn("1", "number of the sample"),
    "flight_id": SampleColumn("1", "identifier of the sample"),
    "callsign": SampleColumn("1", "invented callsign"),
    "icao24": SampleColumn("1", "invented ICAO address"),
    "typecode": SampleColumn("1", "ICAO type designator"),
    "level_fl": SampleColumn("100 ft", "flight level"),
    "time_s": SampleColumn("s", "time since the entry level"),
    "altitude_ft": SampleColumn("ft", "pressure altitude", "barometric_altitude"),
    "CAS": SampleColumn("knot", "calibrated airspeed"),
    "Mach": SampleColumn("1", "Mach number"),
    "TAS": SampleColumn("knot", "true airspeed", "platform_speed_wrt_air"),
    "vertical_rate": SampleColumn("ft/min", "rate of change of pressure altitude, negative downwards"),
    "drag_n": SampleColumn("N", "drag that flies the descent"),
    "thrust_n": SampleColumn("N", "thrust of all engines that the descent asks for, at least that at idle"),
    "fuel_flow_kg_s": SampleColumn("kg/s", "fuel flow of all engines"),
    "fuel_kg": SampleColumn("kg", "fuel burnt since the entry level"),
    "co2_kg": SampleColumn("kg", "carbon dioxide emitted since the entry level"),
    "deviation_k": SampleColumn("K", "temperature that the sample is flown in, minus that of the standard atmosphere"),
    "tailwind": SampleColumn("knot", "wind along the track that the sample is flown in, positive from behind"),
    "distance_nm": SampleColumn("nautical_mile", "distance over the ground since the entry level"),
    "distance_to_go_nm": SampleColumn("nautical_mile", "distance over the ground to the end point"),
    "top_of_descent_nm": SampleColumn(
        "nautical_mile", "distance over the ground from the entry level to the end point"
    ),
    "groundspeed": SampleColumn("knot", "speed over the ground", "platform_speed_wrt_ground"),
    "latitude": SampleColumn("degrees_north", "latitude, WGS84", "latitude"),
    "longitude": SampleColumn("degrees_east", "longitude, WGS84", "longitude"),
    "track": SampleColumn("degree", "direction of flight over the ground, from true north", "platform_course"),
    "timestamp": SampleColumn("UTC", "time", "time"),
}
"""Every column of samples and of flights; temperature and wind stand where samples have their own."""
FUEL = ("thrust_n", "fuel_flow_kg_s", "fuel_kg", "co2_kg")
"""Columns that are there where one model flew the samples."""
