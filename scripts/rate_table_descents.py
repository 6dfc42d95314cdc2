"""Fly descents by a table of rates and speeds, as real ones began, and write the rows that a radar would have of them.

The tables are JSON files as the digital twin bluebird-dt ships and reads them; name the installed ones.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from bluesky_descents import add_plan_arguments, read_plans
from descentflow.core.errors import DataError, DescentflowError
from descentflow.core.files import whole_file
from flying.radar_reports import reports, table
from flying.rate_table import drawn, fly, read_tables


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_plan_arguments(parser)
    parser.add_argument("--profile", type=Path, required=True, help="rates and speeds by class and level")
    parser.add_argument("--mapping", type=Path, help="class of each type (default: classes are named as types)")
    parser.add_argument("--spreads", type=Path, help="how flights differ (default: all fly the table)")
    args = parser.parse_args()
    try:
        plans = read_plans(args)
        tables = read_tables(args.profile)
        classes = json.loads(args.mapping.read_text()) if args.mapping else {}
        spreads = json.loads(args.spreads.read_text())["aircraft"] if args.spreads else {}
        parts = []
        for number in range(args.times):
            generator = np.random.default_rng([args.seed, number])
            for plan in plans:
                name = classes.get(plan.typecode, plan.typecode)
                if name not in tables:
                    raise DataError(
                        f"no table for {plan.typecode}", expected=", ".join(tables), mend="add it, or pass --mapping"
                    )
                own = drawn(tables[name], spreads.get(name, {}), generator)
                parts.append(reports(plan, fly(own, plan), number + 1, args.noise))
        with whole_file(args.out) as temporary:
            table(parts).write_parquet(temporary)
    except DescentflowError as error:
        raise SystemExit(f"error: {error}") from error
    print(f"{len(parts)} descents; wrote {args.out}")


if __name__ == "__main__":
    main()
