"""A study in parts: what is kept of each part scores as the whole did, and no set counts twice."""

import gzip
import json
from dataclasses import replace
from pathlib import Path

import blind_toys
import pytest

from descentflow.core.errors import DataError
from descentflow.simulation.causes import CATALOGUED
from studies.blind_diagnosis.blind_draw import draw_plan
from studies.blind_diagnosis.blind_score import score
from studies.blind_diagnosis.study_evidence import Evidence, pooled, read_evidence, write_evidence

NAMES = tuple(cause.name for cause in CATALOGUED)


def evidence(seed: int, key: str) -> Evidence:
    plan = blind_toys.few_flights(draw_plan(40, seed=seed, n_foreign=10))
    manifest, found = blind_toys.study(plan, NAMES)
    return Evidence.of(plan, {**manifest, "key_sha256": key * 64}, found, {})


def scored(one: Evidence) -> dict[str, object]:
    return score(one.plan, one.manifest, one.diagnoses, one.closings)


def test_what_is_kept_scores_as_the_whole_did(tmp_path: Path) -> None:
    plan = blind_toys.few_flights(draw_plan(40, seed=1, n_foreign=10))
    manifest, found = blind_toys.study(plan, NAMES)
    write_evidence(Evidence.of(plan, manifest, found, {}), tmp_path / "evidence.json.gz")
    assert scored(read_evidence(tmp_path / "evidence.json.gz")) == score(plan, manifest, found, {})


def test_parts_count_together() -> None:
    one, two = evidence(1, "a"), evidence(2, "b")
    whole = scored(pooled([one, two]))
    for world, n in (("own", 80), ("foreign", 20)):
        assert whole["worlds"][world]["sets"] == n  # type: ignore[index]
    parts = [scored(part)["worlds"]["own"]["false_alarms"]["n"] for part in (one, two)]  # type: ignore[index]
    assert whole["worlds"]["own"]["false_alarms"]["n"] == sum(parts)  # type: ignore[index]
    assert whole["diagnosed"] == scored(one)["diagnosed"] + scored(two)["diagnosed"]  # type: ignore[operator]
    assert whole["same_verdicts"]["differing"] == []  # type: ignore[index]


def test_a_key_counts_once() -> None:
    with pytest.raises(DataError, match="each key once"):
        pooled([evidence(1, "a"), evidence(1, "a")])


@pytest.mark.parametrize("content", [b"", b"\x1f\x8b", b"no gzip", b"[]"])
def test_a_damaged_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "evidence.json.gz").write_bytes(content)
    with pytest.raises(DataError, match="evidence of a scored study"):
        read_evidence(tmp_path / "evidence.json.gz")


def test_another_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "evidence.json.gz"
    write_evidence(replace(evidence(1, "a"), diagnoses={}), path)
    content = json.loads(gzip.decompress(path.read_bytes()))
    path.write_bytes(gzip.compress(json.dumps({**content, "schema_version": 99}).encode()))
    with pytest.raises(DataError, match="another version"):
        read_evidence(path)
