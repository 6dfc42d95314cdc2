"""Measure speed against limits and peers, in one run: python scripts/benchmark.py decode."""

import argparse
from importlib import import_module

PARTS = {
    "decode": "the decoder against power, memory and pyBADA",
    "fit": "fits against scikit-learn, scikit-fda and zuko",
    "score": "scores level by level against scipy",
    "fidelity": "samples against held-out flights and generators without physics",
    "sample": "draws of the three densities against scikit-learn, zuko and the paper's times; latency of df.Generator",
    "diagnose": "one diagnosis over the number of flights",
    "simulate": "flights of the simulated world over their number",
    "real": "time over runs of real flights: open types and other programs; samples by folds of aircraft (--fidelity)",
    "exported": "exported samplers in onnxruntime: size and time",
    "prepare": "rows to free descents against pandas, with the curve over sizes",
}
"""Modules of `benchmarks`, each with `add_arguments` and `run`."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="part", required=True)
    for name, what in PARTS.items():
        part = commands.add_parser(name, help=what)
        module = import_module(f"benchmarks.{name}")
        module.add_arguments(part)
        part.set_defaults(run=module.run)
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
