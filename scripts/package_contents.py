"""Check that wheel and sdist hold every file of the package that git tracks: ``package_contents.py WHEEL SDIST``."""

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def tracked() -> set[str]:
    """Files of the package."""
    listing = subprocess.run(["git", "ls-files", "descentflow"], cwd=ROOT, capture_output=True, text=True, check=True)
    return set(listing.stdout.split())


def main(wheel: Path, sdist: Path) -> int:
    """Print what is missing; the exit status."""
    with zipfile.ZipFile(wheel) as archive:
        inside = {"wheel": set(archive.namelist())}
    with tarfile.open(sdist) as archive:
        inside["sdist"] = {name.split("/", 1)[-1] for name in archive.getnames()}
    missing = [f"{kind} lacks {name}" for kind, names in inside.items() for name in sorted(tracked() - names)]
    print("\n".join(missing) or f"wheel and sdist hold all {len(tracked())} files of the package")
    return bool(missing)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
