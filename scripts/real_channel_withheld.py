"""Diagnose real flights with a channel and without, and check the answer by what the diagnosis never saw.

python scripts/real_channel_withheld.py OUT_FOLDER [--netherlands ehs_netherlands_2017-01-11.parquet]
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.core.errors import DescentflowError
from descentflow.diagnosis.diagnose import diagnose
from descentflow.surveillance.descents.prepared_descents import Descents
from studies.blind_diagnosis.real_figures import PER_KFT, real_figure
from studies.blind_diagnosis.real_flights import check_temperature, check_wind
from studies.blind_diagnosis.seal import write_json


def package(descents: Descents, typecode: str, channels: Sequence[str]) -> dict[str, Any]:
    return diagnose(descents, typecode=typecode, channels=channels, any_type=True).as_dict()


def told(title: str, report: dict[str, Any]) -> str:
    lines = [f"{title}: {report['verdict']} (p {report['p_value']:.3g})"]
    for cause in report["causes"]:
        group = f" (or {', '.join(cause['group'])})" if cause["group"] else ""
        sizes = ", ".join(f"{k} {v['estimate']:.3g} {v['unit']}" for k, v in cause["parameters"].items())
        lines.append(f"  {cause['effect']}{group}: {sizes}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--netherlands", type=Path, help="decoded reports of 2017-01-11, not part of the package")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    try:
        air = check_temperature(package)
        print(told("Bengaluru with TAS", air.with_channel))
        print(told("Bengaluru without TAS", air.without))
        print(
            f"  by heights, unseen: {air.by_height.mean_k:.1f} +- {air.by_height.error_k:.1f} K (virtual temperature)"
        )
        print(f"  by TAS and Mach: {air.by_speed.mean_k:.1f} +- {air.by_speed.error_k:.1f} K")
        answers: dict[str, Any] = {
            "bengaluru": {
                "with_tas": air.with_channel,
                "without_tas": air.without,
                "by_heights_k": [air.by_height.mean_k, air.by_height.error_k],
                "by_speeds_k": [air.by_speed.mean_k, air.by_speed.error_k],
            }
        }
        wind = None
        if args.netherlands is not None:
            wind = check_wind(pl.read_parquet(args.netherlands), args.out, package)
            print(told("Netherlands with wind channels", wind.with_channel))
            print(told("Netherlands without", wind.without))
            slope = [PER_KFT * wind.by_others.mean_per_s, PER_KFT * wind.by_others.error_per_s]
            print(f"  by other aircraft, unseen: {slope[0]:+.2f} +- {slope[1]:.2f} kt / 1,000 ft")
            answers["netherlands"] = {
                "with_wind": wind.with_channel,
                "without_wind": wind.without,
                "by_others_kt_per_kft": slope,
            }
        write_json(args.out / "real.json", answers)
        real_figure(air, wind).savefig(args.out / "real_withheld.png", dpi=120, metadata={"Software": None})
    except DescentflowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
