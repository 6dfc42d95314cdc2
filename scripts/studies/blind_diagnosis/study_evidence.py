"""Evidence of a scored study in one small file, and several such studies scored as one.

A study of hundreds of sets takes hours. It may be run in parts of their own keys, each sealed and opened by itself;
what is kept of a part is its key, what was published before, and of every diagnosis what a score looks at.
"""

import gzip
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from descentflow.core.errors import DataError
from descentflow.core.files import whole_file
from descentflow.core.version import __version__
from studies.blind_diagnosis.blind_plan import Plan

SCORED = ("verdict", "p_value", "causes", "where", "gap_before", "gap_after", "floor")
"""Of a report, what a score looks at."""
SCHEMA_VERSION = 1
NAMED = 8
"""Letters of a key's hash by which the sets of a part differ from those of another."""


@dataclass(frozen=True)
class Evidence:
    """A study once its key is open.

    Attributes:
        plan: The key.
        manifest: What was published before.
        diagnoses: By the name of their job, their reports cut to what a score looks at.
        closings: By set, see :func:`studies.blind_diagnosis.closing.closing`.
        version: Of descentflow, whose rules were tried.

    Example:
        >>> one = Evidence(Plan(0, "00", (), ()), {"key_sha256": "ab", "sealed_at": "today", "jobs": []}, {}, {})
        >>> one.version == __version__
        True
    """

    plan: Plan
    manifest: Mapping[str, Any]
    diagnoses: Mapping[str, Any]
    closings: Mapping[str, Any]
    version: str = __version__

    @classmethod
    def of(
        cls,
        plan: Plan,
        manifest: Mapping[str, Any],
        diagnoses: Mapping[str, Any],
        closings: Mapping[str, Any],
    ) -> "Evidence":
        """Cut the reports of an opened study."""
        return cls(plan, manifest, {name: _cut(found) for name, found in diagnoses.items()}, closings)


def write_evidence(evidence: Evidence, path: Path) -> None:
    """Write a compressed JSON file, whole or not at all.

    Args:
        evidence: Of one study.
        path: The file.

    Example:
        >>> one = Evidence(Plan(0, "00", (), ()), {"key_sha256": "ab", "sealed_at": "today", "jobs": []}, {}, {})
        >>> write_evidence(one, Path("evidence.json.gz"))
        >>> read_evidence(Path("evidence.json.gz")) == one
        True
    """
    content = {"schema_version": SCHEMA_VERSION, **asdict(evidence)}
    # In the order that things have: of two causes the first is drawn first.
    text = json.dumps(content, allow_nan=False)
    with whole_file(path) as temporary:
        # Without a time in its head, so that one study is one file.
        temporary.write_bytes(gzip.compress(text.encode(), mtime=0))


def read_evidence(path: Path) -> Evidence:
    """Read what :func:`write_evidence` wrote.

    Raises:
        DataError: If the file is missing, damaged or of another version.

    Example:
        >>> read_evidence(Path("none.json.gz"))
        Traceback (most recent call last):
            ...
        descentflow.core.errors.DataError: ...none.json.gz...
    """
    try:
        content = json.loads(gzip.decompress(path.read_bytes()))
        if content.pop("schema_version") != SCHEMA_VERSION:
            raise ValueError("another version")
        return Evidence(**{**content, "plan": Plan.from_dict(content["plan"])})
    except (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DataError(
            f"{path}: {error}", expected="evidence of a scored study", mend="score the study again with this version"
        ) from error


def pooled(parts: Sequence[Evidence]) -> Evidence:
    """Several studies as one, the names of whose sets begin with their key's hash.

    Args:
        parts: Studies of different keys, at least one.

    Raises:
        DataError: If a key is there twice: no set may count twice.

    Example:
        >>> manifest = {"key_sha256": "ab12", "sealed_at": "today", "jobs": []}
        >>> one = Evidence(Plan(0, "00", (), ()), manifest, {}, {})
        >>> pooled([one, replace(one, manifest={**manifest, "key_sha256": "cd34"})]).manifest["key_sha256"]
        'ab12 cd34'
    """
    keys = [str(part.manifest["key_sha256"]) for part in parts]
    if len(set(keys)) < len(keys):
        raise DataError(
            f"studies of the keys {', '.join(key[:NAMED] for key in keys)}",
            expected="each key once",
            mend="give every study once",
        )
    if len(parts) == 1:
        return parts[0]
    renamed = [_renamed(part, key[:NAMED]) for part, key in zip(parts, keys, strict=True)]
    plan = Plan(
        renamed[0].plan.seed,
        " ".join(part.plan.nonce for part in renamed),
        tuple(one for part in renamed for one in part.plan.sets),
        tuple(one for part in renamed for one in part.plan.simulators),
    )
    manifest = {
        "key_sha256": " ".join(keys),
        "sealed_at": ", ".join(str(part.manifest["sealed_at"]) for part in renamed),
        "jobs": [job for part in renamed for job in part.manifest["jobs"]],
    }
    return Evidence(
        plan,
        manifest,
        {name: found for part in renamed for name, found in part.diagnoses.items()},
        {name: found for part in renamed for name, found in part.closings.items()},
        ", ".join(sorted({part.version for part in renamed})),
    )


def _cut(found: Mapping[str, Any]) -> dict[str, Any]:
    report = found["report"]
    kept = None if report is None else {name: report[name] for name in SCORED if name in report}
    if kept is not None:
        # Of the cells, scores take the largest, and the largest of the rate.
        cells = kept.get("where", [])
        rate = next((cell for cell in cells[1:] if cell["quantity"] == "rate"), None)
        kept["where"] = [*cells[:1], *([] if rate is None else [rate])]
    return {"report": kept, "refused": found["refused"], "cpu_s": found["cpu_s"]}


def _renamed(part: Evidence, prefix: str) -> Evidence:
    """The same study, every name in it with a prefix."""

    def new(name: str) -> str:
        return f"{prefix}_{name}"

    sets = tuple(
        replace(
            one,
            name=new(one.name),
            simulator=new(one.simulator),
            true=None if one.true is None else new(one.true),
        )
        for one in part.plan.sets
    )
    simulators = tuple(replace(one, name=new(one.name)) for one in part.plan.simulators)
    jobs = [{**job, **{key: new(job[key]) for key in ("name", "set", "simulator")}} for job in part.manifest["jobs"]]
    return Evidence(
        replace(part.plan, sets=sets, simulators=simulators),
        {**part.manifest, "jobs": jobs},
        {new(name): found for name, found in part.diagnoses.items()},
        {new(name): found for name, found in part.closings.items()},
        part.version,
    )
