"""Draw BADA's beside the exact energy share factor: python scripts/energy_share_figure.py FIGURE.png [TYPE]."""

import sys

from descentflow.figures.energy_share import energy_share_figure
from descentflow.files import whole_file
from descentflow.performance.open_aircraft import open_aircraft

if __name__ == "__main__":
    path, typecode = sys.argv[1], (sys.argv[2:] or ["A320"])[0]
    with whole_file(path) as temporary:
        energy_share_figure(open_aircraft(typecode)).savefig(temporary, format="png", dpi=90)
