"""Realistic aircraft descents, learnt from surveillance data and flown by BADA's total-energy equation.

The functions that most users need, in the order of the data's path. Each takes what the one before returned, or the
path of a file that holds it, and nothing heavy is imported before it is used:

- :func:`simulate` flies aircraft of known truth, and :func:`aircraft` looks up a type's coefficients;
- :func:`prepare` cleans surveillance rows to descents on flight levels, and :func:`read_descents` reads them again;
- :func:`fit` trains a model (:class:`Gaussian`, :class:`GaussianMixture` or
  :class:`MaskedAffineFlow`) on descents or on a :class:`DescentDataModule`, and :func:`load` reads a checkpoint again;
- :func:`sample` draws descents, :class:`Generator` those that a running simulator asks for, :func:`predict` continues
  observed ones, :func:`evaluate` scores a model,
  :func:`export` writes for other programs;
- :func:`diagnose` finds where a simulator and real flights disagree, and why; :func:`repair` mends coefficients;
  :func:`qualify` judges a simulator by limits, :func:`watch` a simulator day by day.

Import it before torch: how torch's threads wait is settled when torch is loaded, and by default they take the processor
from others meanwhile. Where torch came first (and OMP_WAIT_POLICY and OMP_NUM_THREADS are not set), sampling, scoring
and prediction keep to one thread.

Every error that is raised on purpose is a :class:`DescentflowError`.

Reading order: :mod:`~descentflow.surveillance`, :mod:`~descentflow.representation`, :mod:`~descentflow.densities`,
:mod:`~descentflow.training`, :mod:`~descentflow.generation`, :mod:`~descentflow.evaluation`,
:mod:`~descentflow.diagnosis`; each names the module to read first.

Example:
    >>> import descentflow as df
    >>> descents = df.prepare("rows.parquet", typecode="A320")
    >>> model = df.fit(descents, model="gaussian")
    >>> print(df.evaluate(model, descents, n=500))
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from descentflow.core import threads  # noqa: F401 (before anything loads torch)
from descentflow.core.errors import DescentflowError
from descentflow.core.version import __version__
from descentflow.densities.kinds import KINDS

if TYPE_CHECKING:
    from descentflow.aircraft_types.registry import aircraft
    from descentflow.densities.checkpoint import load_model as load
    from descentflow.diagnosis.diagnose import diagnose
    from descentflow.evaluation.evaluate import evaluate
    from descentflow.exports.export import export
    from descentflow.generation.conditional.generator import Generator
    from descentflow.generation.prediction.predict import predict
    from descentflow.generation.sample import sample
    from descentflow.qualification.qualify import qualify
    from descentflow.repairs.repair import repair
    from descentflow.simulation.world import simulate
    from descentflow.surveillance.descents.prepared_descents import read_descents
    from descentflow.surveillance.prepare import prepare
    from descentflow.training.datamodule import DescentDataModule
    from descentflow.training.fit import fit
    from descentflow.training.models.flow_model import MaskedAffineFlow
    from descentflow.training.models.gaussian_model import Gaussian
    from descentflow.training.models.mixture_model import GaussianMixture
    from descentflow.watching.watch import watch

__all__ = [
    "DescentDataModule",
    "DescentflowError",
    "Gaussian",
    "GaussianMixture",
    "Generator",
    "MaskedAffineFlow",
    "__version__",
    "aircraft",
    "diagnose",
    "evaluate",
    "export",
    "fit",
    "load",
    "predict",
    "prepare",
    "qualify",
    "read_descents",
    "repair",
    "sample",
    "simulate",
    "watch",
]

_PLACES = {
    "DescentDataModule": ("training.datamodule", "DescentDataModule"),
    "Generator": ("generation.conditional.generator", "Generator"),
    "aircraft": ("aircraft_types.registry", "aircraft"),
    "diagnose": ("diagnosis.diagnose", "diagnose"),
    "evaluate": ("evaluation.evaluate", "evaluate"),
    "export": ("exports.export", "export"),
    "fit": ("training.fit", "fit"),
    "load": ("densities.checkpoint", "load_model"),
    "predict": ("generation.prediction.predict", "predict"),
    "prepare": ("surveillance.prepare", "prepare"),
    "qualify": ("qualification.qualify", "qualify"),
    "read_descents": ("surveillance.descents.prepared_descents", "read_descents"),
    "repair": ("repairs.repair", "repair"),
    "sample": ("generation.sample", "sample"),
    "simulate": ("simulation.world", "simulate"),
    "watch": ("watching.watch", "watch"),
    **{kind.model: (f"training.models.{kind.trained_in}", kind.model) for kind in KINDS},
}
"""Name -> the module that has it, and its name there."""


def __getattr__(name: str) -> Any:
    """Import a name on first use (PEP 562)."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, own_name = _PLACES[name]
    public = getattr(import_module(f"{__name__}.{module}"), own_name)
    globals()[name] = public
    return public


def __dir__() -> list[str]:
    """The front door's names."""
    return sorted(__all__)
