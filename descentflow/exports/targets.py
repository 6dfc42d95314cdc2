"""The targets of `descentflow export`; each is a module of its own, imported when it is used."""

from collections.abc import Container
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from descentflow.core.errors import ConfigError

if TYPE_CHECKING:
    from descentflow.exports.export_request import ExportRequest


class Writer(Protocol):
    """Function ``write`` of every target's module.

    Example:
        >>> from descentflow.exports.parquet_export import write
        >>> writer: Writer = write
    """

    def __call__(self, request: "ExportRequest", *others: "ExportRequest") -> list[Path]:
        """Write the files of a target, of several models where it takes them, and return their paths."""


@dataclass(frozen=True)
class ExportTarget:
    """One target: what it is for, the extensions that its output may have, and what must be known of the ground.

    Example:
        >>> TARGETS["traffic"].suffixes, TARGETS["traffic"].placed
        (('.parquet',), True)
    """

    purpose: str
    suffixes: tuple[str, ...]
    placed: bool = False
    """True if it needs a time of arrival, and an end point and a track, or a route."""
    options: tuple[str, ...] = ()
    """Options of :data:`DEFAULTS` that it takes."""
    step_s: float | None = None
    """Seconds from row to row where no other step is asked for; a row for each level if None."""

    def check(self, name: str, request: "ExportRequest") -> None:
        """Refuse a request that the target cannot serve.

        Raises:
            ConfigError: If the extension is another, or it lacks an option.
        """
        if request.path.suffix not in self.suffixes:
            raise ConfigError(
                f"output {request.path.name} for {name}",
                expected=f"an extension among {', '.join(self.suffixes)}",
                mend="rename the output",
            )
        for option, default in DEFAULTS.items():
            value = getattr(request, option)
            if value != default and option not in self.options:
                having = [other for other, target in TARGETS.items() if option in target.options]
                raise ConfigError(
                    f"{option} = {value} for {name}",
                    expected=f"{' or '.join(having)}, which can be asked for it",
                    mend="leave it out",
                )

    def check_ground(self, name: str, given: Container[str]) -> None:
        """Refuse a request that lacks a place or time which the target needs, and say all that it lacks.

        Args:
            name: Of the target.
            given: Names of the arguments of :func:`~descentflow.positions.ground_plan.ground_plan` that have a value.

        Raises:
            ConfigError: Naming the options that are to be given.
        """
        if not self.placed:
            return
        places = {"end": "--end LAT,LON", "track": "--track DEG"} if "route" not in given else {}
        lacking = [option for option in (*places, "end_time") if option not in given]
        if not lacking:
            return
        options = [(places | {"end_time": "--time 2026-11-22T10:00:00"})[option] for option in lacking]
        without = ["places"] * ("end" in lacking) or ["a track at the end point"] * ("track" in lacking)
        without += ["a time"] * ("end_time" in lacking)
        instead = ", or --route LAT,LON LAT,LON for the places" if {"end", "track"} <= {*lacking} else ""
        raise ConfigError(
            f"{name} without {' and '.join(without)}",
            expected="an end point and a track, or a route, and when the first flight passes the lowest level",
            mend=f"give {' '.join(options)}{instead}",
        )

    def writer(self, name: str) -> Writer:
        """The function that writes."""
        write: Writer = import_module(f"descentflow.exports.{name}_export").write
        return write


DEFAULTS = {"models": 1, "precision": "float64", "step_s": None, "prefix": "", "fly_as": ()}
"""Options that some targets have and others refuse, with what they are where nobody asked."""
ROWS, FLEET = ("step_s", "prefix"), ("models", "fly_as")
TARGETS = {
    "parquet": ExportTarget(
        "the table of samples with unit and meaning in each field's metadata", (".parquet",), options=ROWS
    ),
    "cf": ExportTarget("a trajectory file of the CF conventions 1.11 (NetCDF-4)", (".nc",), True, ROWS),
    "traffic": ExportTarget(
        "flights for the library traffic (Traffic.from_file)", (".parquet",), True, ROWS, step_s=1.0
    ),
    "bluesky": ExportTarget(
        "a scenario for BlueSky (.scn), or a plugin that flies samples (.py)",
        (".scn", ".py"),
        options=("prefix", *FLEET),
    ),
    "bluebird": ExportTarget("a predictor for bluebird-dt that flies samples", (".py",), options=FLEET),
    "onnx": ExportTarget(
        "the sampler itself, for onnxruntime in any language: random numbers in, descents out",
        (".onnx",),
        options=("precision",),
    ),
}
"""Every target by its name."""


def target_of(name: str) -> ExportTarget:
    """The target of a name.

    Raises:
        ConfigError: If there is none.

    Example:
        >>> target_of("yaml")
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: target 'yaml'; expected one of parquet, ...; to mend it, ...
    """
    if name not in TARGETS:
        raise ConfigError(f"target {name!r}", expected=f"one of {', '.join(TARGETS)}", mend="correct --to")
    return TARGETS[name]
