"""The steps of a study: generate and seal, diagnose and seal, each resumable and spread over processes."""

import logging
import multiprocessing
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from descentflow.core.errors import DescentflowError
from descentflow.studies.blind_diagnosis.blind_flights import TYPECODE, write_set, write_simulator
from descentflow.studies.blind_diagnosis.blind_plan import REFERENCE_FLIGHTS, Plan
from descentflow.studies.blind_diagnosis.seal import MANIFEST, digest, read_json, seal_diagnoses, seal_key, write_json

Progress = Callable[[str], None]
Diagnose = Callable[[Path, Path, str | None, Path | None], dict[str, Any]]
"""Rows, checkpoint, effect to leave out of the catalogue and folder for the report, to the content of gap.json."""


PUBLISH_EVERY = 20
"""Files after which the manifest is written anew."""


def generate(
    folder: Path,
    plan: Plan,
    *,
    typecode: str = TYPECODE,
    reference_flights: int = REFERENCE_FLIGHTS,
    processes: int = 1,
    progress: Progress = print,
) -> None:
    """Seal the key, then fly every set and train every simulator that is not there yet, and publish the manifest.

    Args:
        folder: Of the study.
        plan: Its key.
        typecode: Type flown.
        reference_flights: Flights flown for each simulator.
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
    begun = {"key_sha256": seal, "sealed_at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), "jobs": []}
    if not (folder / MANIFEST).is_file():
        write_json(folder / MANIFEST, begun)
    work: list[tuple[Any, ...]] = []
    for simulator in plan.simulators:
        path = folder / "simulators" / f"{simulator.name}.ckpt"
        if not path.is_file():
            work.append((write_simulator, simulator, path, typecode, reference_flights))
    for one in sorted(plan.sets, key=lambda one: one.part == "blind"):
        path = folder / "sets" / f"{one.name}.parquet"
        if not path.is_file():
            work.append((write_set, one, path, typecode))

    def count(done: int) -> None:
        progress(f"flown and trained: {done} of {len(work)}")
        if done % PUBLISH_EVERY == 0:
            _publish(folder, plan)

    _spread(work, processes, count)
    _publish(folder, plan)


def _publish(folder: Path, plan: Plan) -> None:
    """Write what is there into the manifest, so that diagnosis may begin before all is flown."""
    manifest = read_json(folder / MANIFEST)
    write_json(folder / MANIFEST, {**manifest, "jobs": _jobs(folder, plan)})


def _jobs(folder: Path, plan: Plan) -> list[dict[str, Any]]:
    """What is to be diagnosed: nothing of what was injected, except effects that are left out of the catalogue."""
    jobs = []
    for one in plan.sets:
        rows = folder / "sets" / f"{one.name}.parquet"
        if not rows.is_file():
            continue
        job = {"name": one.name, "rows_sha256": digest(rows), "set": one.name, "simulator": one.simulator}
        jobs.append({**job, "without": None, "corrected": one.part == "withheld"})
        if one.part == "withheld":
            jobs.append({**job, "name": f"{one.name}_without", "without": next(iter(one.causes)), "corrected": False})
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

    Example:
        >>> for name in ("sets", "diagnoses"):
        ...     (Path("one_set") / name).mkdir(parents=True)
        >>> job = {"name": "blind_0000", "set": "blind_0000", "simulator": "simulator_000", "without": None}
        >>> write_json(Path("one_set") / MANIFEST, {"jobs": [{**job, "corrected": False}]})
        >>> finds_nothing = lambda rows, simulator, without, out: {"verdict": "none", "causes": []}
        >>> diagnose_all(Path("one_set"), diagnose=finds_nothing)
        diagnosed: 1 of 1, ... s each, 0 min to go
        1
    """
    jobs = list(read_json(folder / MANIFEST)["jobs"])
    jobs.sort(key=lambda job: not job["name"].startswith(tuple(parts)))
    left = [job for job in jobs if not (folder / "diagnoses" / f"{job['name']}.json").is_file()]
    work = [(_one, folder, job, diagnose or package_diagnosis, until) for job in left]
    begun = time.monotonic()

    def count(done: int) -> None:
        pace = (time.monotonic() - begun) / done
        progress(f"diagnosed: {done} of {len(left)}, {pace:.1f} s each, {pace * (len(left) - done) / 60:.0f} min to go")

    _spread(work, processes, count)
    return seal_diagnoses(folder, [job["name"] for job in jobs])


def package_diagnosis(rows: Path, simulator: Path, without: str | None, out: Path | None = None) -> dict[str, Any]:
    """The diagnosis under test, with one effect left out of its catalogue if asked for.

    Args:
        rows: Flights of a set.
        simulator: Checkpoint that they are compared with.
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


def _one(folder: Path, job: dict[str, Any], diagnose: Diagnose, until: float | None) -> None:
    """Diagnose one set; a diagnosis that refuses is a result, and is scored as one that found nothing."""
    if until is not None and time.time() > until:
        return
    wall, cpu = time.perf_counter(), time.process_time()
    paths = folder / "sets" / f"{job['set']}.parquet", folder / "simulators" / f"{job['simulator']}.ckpt"
    result: dict[str, Any] = {"job": job, "report": None, "refused": None}
    try:
        out = folder / "reports" / job["name"] if job["corrected"] else None
        result["report"] = diagnose(*paths, job["without"], out)
    except DescentflowError as error:
        result["refused"] = f"{type(error).__name__}: {error}"
    result |= {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}
    write_json(folder / "diagnoses" / f"{job['name']}.json", result)


def _spread(work: Sequence[tuple[Any, ...]], processes: int, count: Callable[[int], None]) -> None:
    """Call functions with their arguments, in this process or in several, and count those that are done."""
    if processes == 1:
        for done, (function, *arguments) in enumerate(work, start=1):
            function(*arguments)
            count(done)
        return
    # Spawned, for a forked process inherits torch's threads in whatever state they are.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context, initializer=_alone) as pool:
        futures: list[Future[Any]] = [pool.submit(function, *arguments) for function, *arguments in work]
        for done, future in enumerate(_finished(futures), start=1):
            future.result()
            count(done)


def _finished(futures: list[Future[Any]]) -> Iterable[Future[Any]]:
    """Futures as they finish; the first error cancels the rest."""
    try:
        yield from as_completed(futures)
    except BaseException:
        for future in futures:
            future.cancel()
        raise


def _alone() -> None:
    """A worker keeps to one thread and says nothing."""
    import torch

    torch.set_num_threads(1)
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)
