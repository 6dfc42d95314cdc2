"""Fields of weather models: temperature and wind on pressure levels by place and time, from NetCDF or GRIB.

Read :mod:`~descentflow.weather.weather_field` (values at places), then :mod:`~descentflow.weather.weather_file` (files)
and :mod:`~descentflow.weather.weather_layout` (their axes, variables and units).
"""
