"""`gap.json` holds all that was found: read back, it is the same; what is not as it should be is refused."""

import json
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import finding_toys
import pytest

from descentflow.core.errors import DataError
from descentflow.diagnosis.findings.findings import Findings
from descentflow.diagnosis.findings.plain_values import primitives
from descentflow.diagnosis.findings.read_gap import SCHEMA_VERSION, read_gap


def written(folder: Path, **changed: Any) -> Path:
    """A `gap.json` of the toys with some keys changed; ``...`` takes a key away."""
    content = {"schema_version": SCHEMA_VERSION, **primitives(finding_toys.findings())} | changed
    path = folder / "gap.json"
    path.write_text(json.dumps({key: value for key, value in content.items() if value is not ...}, allow_nan=False))
    return path


def test_what_was_found_is_read_back_as_it_was(tmp_path: Path) -> None:
    findings = finding_toys.findings()
    # A field that the toys leave empty would be read back right by chance.
    for part in (
        findings,
        findings.details,
        findings.causes[1],
        findings.provenance,
        findings.provenance.real,
        findings.previous,
    ):
        empty = [field.name for field in fields(part) if getattr(part, field.name) in ([], {}, None, "")]
        assert empty in ([], ["group", "alternatives"], ["corrections"])  # what writes files is not in one
    assert read_gap(written(tmp_path)) == findings


def test_fields_with_a_default_may_be_absent(tmp_path: Path) -> None:
    optional = [f for f in fields(Findings) if f.default is not MISSING or f.default_factory is not MISSING]
    assert len(optional) >= 8
    gap = read_gap(written(tmp_path, **{f.name: ... for f in optional}))
    assert gap.costs == []
    assert gap.provenance.real.name == ""
    assert gap.causes == finding_toys.findings().causes


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"schema_version": 4}, "schema version 4; expected version 7; to mend it, diagnose the same flights again"),
        ({"schema_version": ...}, "no schema_version"),
        ({"floor": ...}, "floor: nothing; expected a value"),
        ({"floor": "0.1"}, "floor: 0.1; expected a finite number"),
        ({"verdict": "perhaps"}, "verdict: perhaps; expected 'none' or 'effect' or 'partial' or 'unknown'"),
        ({"causes": {}}, "causes: dict; expected a list"),
        ({"where": [{"quantity": 3}]}, r"where\[0\]: quantity: int; expected a text"),
        ({"surprise": 1}, "unknown fields surprise"),
    ],
)
def test_what_is_no_gap_json_of_this_version_is_refused(tmp_path: Path, changed: Any, message: str) -> None:
    with pytest.raises(DataError, match=message):
        read_gap(written(tmp_path, **changed))


def test_a_file_that_is_missing_or_cut_off_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="No such file"):
        read_gap(tmp_path / "none.json")
    path = written(tmp_path)
    path.write_text(path.read_text()[:-20])
    with pytest.raises(DataError, match="to mend it, write it again"):
        read_gap(path)
