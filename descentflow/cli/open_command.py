"""`descentflow open`: a run's settings, curves and scores in one page."""

import argparse
from pathlib import Path

from descentflow.core.seeds import seed_word


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Write one page of a run into its folder, run.html, and print its path: settings, loss curves, scores beside "
        "noise floors, rejections, profiles against held-out flights. The page needs nothing but itself. Scores are "
        "those of `descentflow test`; where there are none, they are taken first."
    )
    parser.add_argument("run", type=Path, help="folder of the run (runs/NAME/version_N), or its checkpoint")
    parser.add_argument("-n", "--number", type=int, default=10_000, help="samples to score (default: %(default)s)")
    parser.add_argument("--seed", type=seed_word, default=0, help="of these samples (default: 0)")
    parser.add_argument("--browser", action="store_true", help="also open the page in the browser")


def run(args: argparse.Namespace) -> None:
    """Write the page, and say where it is."""
    from descentflow.training.run_page.found_run import find_run

    # Before seconds of imports.
    find_run(args.run)
    from descentflow.core.threads import one_thread_unless_told
    from descentflow.training.run_page.run_page import write_run_page

    one_thread_unless_told()
    page = write_run_page(args.run, n=args.number, seed=args.seed)
    print(page)
    if args.browser:
        import webbrowser

        webbrowser.open(page.resolve().as_uri())
