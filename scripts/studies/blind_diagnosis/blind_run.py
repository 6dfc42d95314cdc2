"""The steps of a study: generate and seal, diagnose and seal, each resumable and spread over processes."""

import resource
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from descentflow.core.errors import DataError, DescentflowError
from studies.blind_diagnosis.blind_flights import simulator_path, write_set, write_simulator
from studies.blind_diagnosis.blind_plan import FORMS, Form, Plan, SimulatorPlan
from studies.blind_diagnosis.closing import closing, fly_fresh
from studies.blind_diagnosis.processes import pace, spread
from studies.blind_diagnosis.seal import (
    MANIFEST,
    digest,
    read_json,
    refuse_if_open,
    seal_diagnoses,
    seal_key,
    write_json,
)

Progress = Callable[[str], None]
Diagnose = Callable[[Path, Path, str | None, Path | None], dict[str, Any]]
"""Rows, simulator (checkpoint or its flights), effect to leave out of the catalogue and folder for the report, to the
content of gap.json."""


OF_CLOSURE: tuple[Form, ...] = ("flights", "bare")
"""Forms of a simulator whose corrected flights are kept."""
PUBLISH_EVERY = 20
"""Files after which the manifest is written anew."""


def generate(
    folder: Path,
    plan: Plan,
    *,
    forms: Sequence[Form] = FORMS,
    until: float | None = None,
    processes: int = 1,
    progress: Progress = print,
) -> None:
    """Seal the key, then fly every set and train every simulator that is not there yet, and publish the manifest.

    Args:
        folder: Of the study.
        plan: Its key.
        forms: Of the simulators; only with all of them are closures measured.
        until: Time (s since 1970) after which nothing more is flown; sets come in random order.
        processes: How many work at once.
        progress: Progress callback, called with a line of text.

    Raises:
        ConfigError: If the folder holds a study of another key.

    Example:
        >>> folder, no_sets = Path("blind_study"), Plan(seed=0, nonce="00", sets=(), simulators=())
        >>> generate(folder, no_sets)  # with sets and simulators it flies and trains for minutes
        >>> read_json(folder / MANIFEST)["key_sha256"] == digest(folder / "sealed_key.json")
        True
    """
    for name in ("sets", "simulators", "diagnoses"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    seal = seal_key(folder, plan)
    started = {"key_sha256": seal, "sealed_at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), "jobs": []}
    if not (folder / MANIFEST).is_file():
        write_json(folder / MANIFEST, started)
    work: list[tuple[Any, ...]] = []
    for form in sorted(forms, key=lambda form: form == "checkpoint"):  # which is trained on the flights
        for simulator in plan.simulators:
            path = simulator_path(folder / "simulators", simulator.name, form)
            if not path.is_file():
                work.append((_of_key, folder, seal, until, write_simulator, (simulator, form), path))
    for drawn in plan.sets:
        path = folder / "sets" / f"{drawn.name}.parquet"
        if not path.is_file():
            work.append((_of_key, folder, seal, until, write_set, (drawn,), path))
    begun = time.monotonic()

    def count(done: int) -> None:
        progress(f"flown and trained: {done} of {len(work)}, {pace(begun, done, len(work))}")
        if done % PUBLISH_EVERY == 0:
            _publish(folder, plan, forms)

    spread(work, processes, count)
    _publish(folder, plan, forms)


def _of_key(
    folder: Path, seal: str, until: float | None, write: Callable[..., None], what: tuple[Any, ...], path: Path
) -> None:
    """Write a file of the study in time, if its folder still holds the study that was begun.

    Sets and simulators of any two keys have the same names.
    """
    if until is not None and time.time() > until:
        return
    seal_there = read_json(folder / MANIFEST)["key_sha256"]
    if seal_there != seal:
        raise DataError(
            f"{folder} holds the study of the key {seal_there[:8]}...",
            expected=f"that of {seal[:8]}..., for which {path.name} was to be written",
            mend="give every study a folder of its own",
        )
    write(*what, path)


def _publish(folder: Path, plan: Plan, forms: Sequence[Form]) -> None:
    """Write what is there into the manifest, so that diagnosis may begin before all is flown."""
    manifest = read_json(folder / MANIFEST)
    write_json(folder / MANIFEST, {**manifest, "jobs": _jobs(folder, plan, forms)})


def _jobs(folder: Path, plan: Plan, forms: Sequence[Form]) -> list[dict[str, Any]]:
    """Diagnoses to make: without what was injected, except effects that are left out of the catalogue."""
    jobs = []
    for drawn in plan.sets:
        rows = folder / "sets" / f"{drawn.name}.parquet"
        if not rows.is_file():
            continue
        common = {"rows_sha256": digest(rows), "set": drawn.name, "simulator": drawn.simulator, "without": None}
        for form in forms:
            closure = drawn.closure and form in OF_CLOSURE and len(forms) == len(FORMS)
            jobs.append({**common, "name": f"{drawn.name}_{form}", "form": form, "closure": closure})
        if drawn.part == "withheld":
            without = {"name": f"{drawn.name}_without", "form": "flights", "without": next(iter(drawn.causes))}
            jobs.append({**common, **without, "closure": False})
    return jobs


def diagnose_all(
    folder: Path,
    *,
    diagnose: Diagnose | None = None,
    processes: int = 1,
    until: float | None = None,
    parts: Sequence[str] = (),
    progress: Progress = print,
) -> int:
    """Diagnose every job of the manifest that has no diagnosis yet, and record the hashes of all.

    Args:
        folder: Of the study.
        diagnose: The diagnosis under test; the package's own if absent.
        processes: How many work at once.
        until: Time (s since 1970) after which no further diagnosis is begun; sets come in random order, so that those
            done by then are a random sample.
        parts: Beginnings of the names of jobs to do first; all the others follow.
        progress: Progress callback, called with a line of text.

    Returns:
        How many diagnoses are recorded.

    Raises:
        DataError: If a recorded diagnosis was changed, or the key was opened before all were done.

    Example:
        >>> for name in ("sets", "diagnoses"):
        ...     (Path("one_set") / name).mkdir(parents=True)
        >>> job = {"name": "blind_0000_bare", "set": "blind_0000", "simulator": "simulator_000", "form": "bare"}
        >>> write_json(Path("one_set") / MANIFEST, {"jobs": [{**job, "without": None, "closure": False}]})
        >>> finds_nothing = lambda rows, simulator, without, out: {"verdict": "none", "causes": []}
        >>> diagnose_all(Path("one_set"), diagnose=finds_nothing)
        diagnosed: 1 of 1, ... s each, 0 min to go
        1
    """
    jobs = list(read_json(folder / MANIFEST)["jobs"])
    jobs.sort(key=lambda job: not job["name"].startswith(tuple(parts)))
    left = [job for job in jobs if not (folder / "diagnoses" / f"{job['name']}.json").is_file()]
    if left:
        refuse_if_open(folder)
    work = [(_one, folder, job, diagnose or package_diagnosis, until) for job in left]
    begun = time.monotonic()

    def count(done: int) -> None:
        progress(f"diagnosed: {done} of {len(left)}, {pace(begun, done, len(left))}")

    spread(work, processes, count)
    return seal_diagnoses(folder, [job["name"] for job in jobs])


def package_diagnosis(rows: Path, simulator: Path, without: str | None, out: Path | None = None) -> dict[str, Any]:
    """The diagnosis under test, with one effect left out of its catalogue if asked for.

    Args:
        rows: Flights of a set.
        simulator: Checkpoint, or prepared descents of the simulator, that they are compared with.
        without: Effect that is left out of the catalogue, if any.
        out: Folder for the report, if wanted.

    Returns:
        Content of ``gap.json``.

    Raises:
        DescentflowError: If the diagnosis refuses the flights or the simulator.

    Example:
        >>> package_diagnosis(Path("none.parquet"), Path("best.ckpt"), without="mass")  # a real one takes a minute
        Traceback (most recent call last):
            ...
        descentflow.core.errors.DataError: ...none.parquet...
    """
    from descentflow.diagnosis.diagnose import diagnose
    from descentflow.effects import EFFECTS

    catalogue = {name: effect for name, effect in EFFECTS.items() if name != without}
    return diagnose(rows, simulator, catalogue=catalogue, seed=0, out=out).as_dict()


def measure_closures(
    folder: Path,
    plan: Plan,
    manifest: Mapping[str, Any],
    *,
    processes: int = 1,
    prefix: str = "",
    progress: Progress = print,
) -> dict[str, Any]:
    """Measure closures by fresh flights, once the key is open.

    Args:
        folder: Of the study.
        plan: Its key.
        manifest: What was published.
        processes: How many work at once.
        prefix: Of the names of jobs.
        progress: Progress callback, called with a line of text.

    Returns:
        By job, see :func:`studies.blind_diagnosis.closing.closing`; without those that have nothing to measure.

    Example:
        >>> measure_closures(Path("."), Plan(0, "00", (), ()), {"jobs": []})
        {}
    """
    (folder / "closures").mkdir(exist_ok=True)
    simulators = {each.name: each for each in plan.simulators}
    jobs = {job["name"]: job for job in manifest["jobs"] if job["closure"]}
    files = {name: folder / "closures" / f"{name}.json" for name in jobs}
    left = [name for name, path in files.items() if not path.is_file()]
    fresh = {(jobs[name]["simulator"], jobs[name]["form"]) for name in left}
    flights = [(fly_fresh, simulators[name], form, folder / "simulators") for name, form in sorted(fresh)]
    begun = time.monotonic()
    spread(flights, processes, lambda n: progress(f"fresh flights: {n} of {len(flights)}"))
    work = [(_measure_closure, folder, jobs[name], simulators[jobs[name]["simulator"]], files[name]) for name in left]
    spread(work, processes, lambda n: progress(f"closures: {n} of {len(work)}, {pace(begun, n, len(work))}"))
    measured = {name: read_json(path) for name, path in files.items()}
    return {f"{prefix}{name}": each for name, each in measured.items() if each is not None}


def _measure_closure(folder: Path, job: Mapping[str, Any], simulator: SimulatorPlan, path: Path) -> None:
    fresh = fly_fresh(simulator, job["form"], folder / "simulators")
    write_json(path, closing(folder / "sets" / f"{job['set']}.parquet", fresh, folder / "reports" / job["name"]))


def how_long(folder: Path) -> str:
    """Times of the diagnoses that exist: the median and the slowest by name, and the most memory.

    Args:
        folder: Of the study.

    Raises:
        DataError: If the study has no manifest.

    Example:
        >>> folder = Path("timed")
        >>> (folder / "diagnoses").mkdir(parents=True)
        >>> write_json(folder / MANIFEST, {"jobs": [{"name": "blind_0000", "form": "flights"}]})
        >>> write_json(folder / "diagnoses" / "blind_0000.json", {"cpu_s": 8.0, "most_memory_gb": 0.9})
        >>> print(how_long(folder))
        flights: 1 diagnosed, median 8.0 s of processor time, slowest 8.0 s (blind_0000), at most 0.90 GB
    """
    lines = []
    jobs = read_json(folder / MANIFEST)["jobs"]
    for form in sorted({job["form"] for job in jobs}):
        files = {j["name"]: folder / "diagnoses" / f"{j['name']}.json" for j in jobs if j["form"] == form}
        diagnoses = {name: read_json(path) for name, path in files.items() if path.is_file()}
        if diagnoses:
            seconds = {name: float(diagnosis["cpu_s"]) for name, diagnosis in diagnoses.items()}
            slowest = max(seconds, key=lambda name: seconds[name])
            lines.append(
                f"{form}: {len(diagnoses)} diagnosed, median {statistics.median(seconds.values()):.1f} s of processor "
                f"time, slowest {seconds[slowest]:.1f} s ({slowest}), at most "
                f"{max(float(diagnosis['most_memory_gb']) for diagnosis in diagnoses.values()):.2f} GB"
            )
    return "\n".join(lines)


def _one(folder: Path, job: dict[str, Any], diagnose: Diagnose, until: float | None) -> None:
    """Diagnose one set; a diagnosis that refuses is a result, and is scored as one that found nothing."""
    if until is not None and time.time() > until:
        return
    wall, cpu = time.perf_counter(), time.process_time()
    simulator = simulator_path(folder / "simulators", job["simulator"], job["form"])
    paths = folder / "sets" / f"{job['set']}.parquet", simulator
    result: dict[str, Any] = {"job": job, "report": None, "refused": None}
    try:
        out = folder / "reports" / job["name"] if job["closure"] else None
        result["report"] = diagnose(*paths, job["without"], out)
    except DescentflowError as error:
        result["refused"] = f"{type(error).__name__}: {error}"
    result |= {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}
    # Of the process, which diagnosed others before; in kilobytes on Linux.
    result["most_memory_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    write_json(folder / "diagnoses" / f"{job['name']}.json", result)
