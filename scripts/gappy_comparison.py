"""Hide levels of descents and compare methods to fill them: python scripts/gappy_comparison.py DESCENTS FIGURE.png."""

import sys

from descentflow.core.files import whole_file
from descentflow.core.units import KT_MPS
from descentflow.training.datamodule import DescentDataModule
from studies.paper.figures.hidden_errors import gappy_figure
from studies.paper.hidden_levels import PATTERNS, hidden_errors


def main(descents: str, path: str, aircraft: str | None = None) -> None:
    data = DescentDataModule(descents, aircraft=aircraft)
    data.setup()
    real = data.profiles("train")
    curves = {"drag": real.drag_n / 1000, "CAS": real.cas_mps / KT_MPS}
    speed = (real.cas_mps * real.mask).sum(1) / real.mask.sum(1)
    found = {
        name: [e for pattern in PATTERNS for e in hidden_errors(values, real.mask, pattern, speed=speed)]
        for name, values in curves.items()
    }
    for name, errors in found.items():
        for e in errors:
            print(f"{name:<6}{e.pattern:<8}{e.method:<20}{e.rmse:8.3f}   {e.n_flights} flights, {e.n_levels} levels")
    with whole_file(path) as temporary:
        gappy_figure(found, {"drag": "kN", "CAS": "kt"}).savefig(temporary, format="png", dpi=90)


if __name__ == "__main__":
    main(*sys.argv[1:])
