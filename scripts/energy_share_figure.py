"""Draw BADA's next to the exact energy share factor: python scripts/energy_share_figure.py FIGURE.png [TYPE]."""

import sys

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.reporting.figure_file import write_figure
from studies.aircraft.energy_share_figure import energy_share_figure

if __name__ == "__main__":
    write_figure(energy_share_figure(open_aircraft(*(sys.argv[2:] or ["A320"]))), sys.argv[1], 90)
