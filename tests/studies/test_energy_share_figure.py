import numpy as np

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from studies.aircraft.energy_share_figure import energy_share_figure


def test_the_figure_holds_one_speed_and_three_rates_and_times() -> None:
    """Fed from the decoder: where Mach or CAS is held as BADA thinks, both factors give one rate; times differ."""
    speed, rate, time = energy_share_figure(open_aircraft("A320")).axes
    cas = [line.get_xdata() for line in speed.lines]
    assert np.array_equal(cas[0], cas[1])
    assert np.array_equal(cas[0], cas[2])
    level = rate.lines[0].get_ydata()
    bada, exact, windy = (line.get_xdata() for line in rate.lines)
    # FL330-350: Mach held in the troposphere, by this flight and by BADA; the slope is differenced over 30 m.
    held = (level > 330) & (level < 350)
    assert np.abs(exact[held] / bada[held] - 1).max() < 1e-3
    # A tailwind that falls off downwards slows every descent.
    assert (windy < exact).all()
    assert np.ptp([line.get_xdata()[0] for line in time.lines]) > 0.5
