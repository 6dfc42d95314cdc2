"""EUROCONTROL's dummy aircraft of BADA 4, inside the installed pybada, and their printed tables."""

import importlib.util
from pathlib import Path

import torch
from torch import Tensor

DUMMIES = ("Dummy-TWIN", "Dummy-TWIN-plus", "Dummy-TBP", "Dummy-PST")
COLUMNS = ["level", "T", "p", "rho", "a", "TAS", "CAS", "M", "mass", "thrust", "drag", "fuel", "ESF", "rod", "gamma"]


def dummies(family: str = "BADA4") -> Path:
    """Their folder, or that of the dummies of BADA 3."""
    spec = importlib.util.find_spec("pyBADA")
    assert spec is not None, "the test extra installs pybada"
    return Path(str(spec.origin)).parent / "aircraft" / family / "DUMMY"


def printed_descents(name: str, warmer: bool) -> list[tuple[dict[str, Tensor], list[str]]]:
    """Columns and configurations of the descents in a printed table (PTD), at low, medium and high mass."""
    text = (dummies() / name / f"{name}_ISA{'+20' if warmer else ''}.PTD").read_text()
    descents = []
    for part in text.split(" DESCENT\n")[1:]:
        rows = [line.split() for line in part.split("mass CRUISE")[0].split("mass DESCENT")[0].splitlines()]
        rows = [row for row in rows if len(row) > len(COLUMNS) and row[0].isdecimal()]
        numbers = torch.tensor([[float(cell) for cell in row[: len(COLUMNS)]] for row in rows], dtype=torch.float64)
        descents.append((dict(zip(COLUMNS, numbers.T, strict=True)), [row[len(COLUMNS)] for row in rows]))
    return descents
