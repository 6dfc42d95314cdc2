"""The set-up script names what it cannot set up, before pip fails over it."""

import subprocess
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "setup_environment.sh"


def test_traffic_is_sent_to_an_environment_of_its_own() -> None:
    for extras in ("traffic,pandas", "traffic"):
        told = subprocess.run(["bash", str(SCRIPT), extras], capture_output=True, text=True, check=False)
        assert told.returncode == 1
        assert "the extra traffic wants pandas below 3" in told.stderr
        assert "docs/how-to/export_traffic.md" in told.stderr
