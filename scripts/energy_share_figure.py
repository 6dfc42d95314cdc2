"""Draw BADA's beside the exact energy share factor: python scripts/energy_share_figure.py FIGURE.png [TYPE]."""

import sys

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.core.files import whole_file
from studies.aircraft.energy_share_figure import energy_share_figure

if __name__ == "__main__":
    path, typecode = sys.argv[1], (sys.argv[2:] or ["A320"])[0]
    with whole_file(path) as temporary:
        energy_share_figure(open_aircraft(typecode)).savefig(temporary, format="png", dpi=90)
