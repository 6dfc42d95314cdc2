"""Gaussian mixture over the weights, defined by a Pyro model (paper, section 2.3 and appendix C)."""

from typing import Any, Literal

import pyro
import pyro.distributions as dist
import torch
from jsonargparse.typing import PositiveFloat, PositiveInt
from lightning.pytorch.utilities.types import OptimizerLRSchedulerConfig
from pyro import poutine
from pyro.infer import TraceEnum_ELBO, config_enumerate
from pyro.nn import PyroModule, PyroParam
from torch import Tensor
from torch.distributions import constraints
from tqdm import tqdm

from descentflow.errors import ConfigError
from descentflow.models.base import LatentModel
from descentflow.models.em import (
    Mixture,
    best_start,
    expectation,
    fit_mixture,
    maximisation,
    quadratic_features,
    select_mixture,
)
from descentflow.models.optimizers import ClosedForm, adam_with_cosine

# Without this two mixtures in one process share their parameters by name.
pyro.settings.set(module_local_params=True)

Training = Literal["em", "svi"]


class MixtureProgram(PyroModule):
    """The probabilistic program: a cluster for each flight, then weights from that cluster's Gaussian.

    ``z ~ Categorical(probs)``, ``w | z ~ N(locs[z], scale_trils[z] scale_trils[z]')``
    """

    probs: Tensor
    locs: Tensor
    scale_trils: Tensor

    def __init__(self, n_clusters: int, dimension: int) -> None:
        """Equal clusters at the origin."""
        super().__init__()
        eye = torch.eye(dimension, dtype=torch.float64).expand(n_clusters, -1, -1).contiguous()
        probs = torch.full((n_clusters,), 1 / n_clusters, dtype=torch.float64)
        zeros = torch.zeros(n_clusters, dimension, dtype=torch.float64)
        self.probs = PyroParam(probs, constraints.simplex)  # type: ignore[assignment]
        self.locs = PyroParam(zeros)  # type: ignore[assignment]
        self.scale_trils = PyroParam(eye, constraints.lower_cholesky)  # type: ignore[assignment]

    @config_enumerate  # type: ignore[untyped-decorator]
    def forward(self, n: int, weights: Tensor | None = None) -> Tensor:
        """Draw n flights' weights, or condition on those given: (n, d)."""
        with pyro.plate("flights", n):
            cluster = pyro.sample("cluster", dist.Categorical(self.probs))
            flight = dist.MultivariateNormal(self.locs[cluster], scale_tril=self.scale_trils[cluster])
            drawn: Tensor = pyro.sample("weights", flight, obs=weights)
        return drawn

    def guide(self, n: int, weights: Tensor | None = None) -> None:
        """Nothing to approximate: the only latent variable is enumerated exactly."""


class GaussianMixture(LatentModel):
    """Gaussian mixture whose log density, sampling and SVI loss come from one Pyro program.

    Trained by expectation maximisation (``em``, the default: each training step is one E and M step over the
    whole training part) or by stochastic variational inference with an enumerated ELBO (``svi``). The number of
    clusters is chosen by BIC with at least 15 training flights a parameter, unless it is given.

    Example:
        >>> Trainer(max_epochs=100).fit(GaussianMixture(), datamodule=data)
    """

    def __init__(
        self,
        n_clusters: PositiveInt | None = None,
        training: Training = "em",
        n_restarts: PositiveInt = 8,
        tolerance: PositiveFloat = 1e-6,
        learning_rate: PositiveFloat = 0.005,
        seed: int = 0,
    ) -> None:
        """Set the hyperparameters.

        Args:
            n_clusters: Number of clusters; chosen by BIC if absent.
            training: ``em`` or ``svi``.
            n_restarts: k-means++ starts for each number of clusters; eight reach what fewer miss by 0.3 nats.
            tolerance: EM has converged when the mean log-likelihood gains less (nats a flight).
            learning_rate: Of Adam in ``svi``; larger steps throw narrow clusters off a good start.
            seed: Of the starts.
        """
        super().__init__()
        self.save_hyperparameters()
        if training not in ("em", "svi"):
            raise ConfigError(f"training {training!r}", expected="'em' or 'svi'", mend="choose one of them")
        self.training_method = training
        self.automatic_optimization = training == "svi"
        self.n_clusters, self.n_restarts, self.tolerance = n_clusters, n_restarts, tolerance
        # A built-in float: the optimizer's state keeps it, and a checkpoint holds primitives only.
        self.learning_rate, self.seed = float(learning_rate), seed
        self.bic: dict[int, float] = {}
        self._restored = False
        self._batches: list[Tensor] = []

    def build(self, dimension: int) -> None:
        """A program of the given number of clusters, or of one until BIC has chosen."""
        self.program = MixtureProgram(self.n_clusters or 1, dimension)

    @property
    def mixture(self) -> Mixture:
        """The program's parameters."""
        return Mixture(self.program.probs, self.program.locs, self.program.scale_trils)

    def log_prob(self, weights: Tensor) -> Tensor:
        """Log density (n,) of standardised weights (n, d): the program's, summed over the enumerated cluster."""
        weights = weights.to(torch.float64)
        enumerated = poutine.enum(self.program, first_available_dim=-2)
        trace = poutine.trace(enumerated).get_trace(len(weights), weights)
        trace.compute_log_prob()
        joint = trace.nodes["cluster"]["log_prob"] + trace.nodes["weights"]["log_prob"]
        total: Tensor = joint.logsumexp(0)
        return total

    def draw(self, n: int) -> Tensor:
        """Draw (n, d)."""
        drawn: Tensor = self.program(n)
        return drawn

    def _initialise(self) -> None:
        """Choose the number of clusters and the starting point from the training flights."""
        weights = self.trainer.datamodule.weights("train").to(self.device, torch.float64)  # type: ignore[attr-defined]
        best = self._search(weights)
        if self.training_method == "svi":
            best = best_start(weights, len(best.probs), seed=self.seed, n_restarts=self.n_restarts)
        self._set(best)

    def _search(self, weights: Tensor) -> Mixture:
        if self.n_clusters is not None:
            return fit_mixture(weights, self.n_clusters, seed=self.seed, n_restarts=self.n_restarts)[0]
        with tqdm(desc="clusters by BIC", unit="k", leave=False, delay=2) as bar:

            def show(most: int) -> None:
                bar.total = most
                bar.update()

            selection = select_mixture(weights, seed=self.seed, n_restarts=self.n_restarts, progress=show)
        self.bic = selection.bic
        chosen = len(selection.mixture.probs)
        cap = " (the cap of 15 flights a parameter decides: more clusters might fit better)"
        self.print(f"BIC chooses {chosen} of 1..{max(self.bic)} clusters{cap if selection.cap_binds else ''}")
        return selection.mixture

    @torch.no_grad()
    def _set(self, mixture: Mixture) -> None:
        """Give the program these parameters, in the parameters that the optimizer holds where shapes allow."""
        if self.program.probs.shape != mixture.probs.shape:
            self.program = MixtureProgram(len(mixture.probs), mixture.locs.shape[1]).to(self.device)
        self.program.probs = mixture.probs
        self.program.locs = mixture.locs
        self.program.scale_trils = mixture.scale_trils

    def training_step(self, batch: tuple[Tensor, ...], batch_index: int) -> Tensor | None:
        """One EM step over all training flights, or the enumerated ELBO of a batch."""
        if self.training_method == "svi":
            weights = batch[0].to(torch.float64)
            elbo = TraceEnum_ELBO(max_plate_nesting=1)
            loss: Tensor = elbo.differentiable_loss(self.program, self.program.guide, len(weights), weights)
            self.log("train/nll", loss / len(weights), on_epoch=True, on_step=False, batch_size=len(weights))
            return loss / len(weights)
        self._batches.append(batch[0].to(torch.float64))
        if self.trainer.is_last_batch:
            features, self._batches = quadratic_features(torch.cat(self._batches)), []
            self.optimizers().step(closure=lambda: self._em_step(features))  # type: ignore[union-attr]
        return None

    @torch.no_grad()
    def _em_step(self, features: Tensor) -> None:
        responsibilities, before = expectation(features, self.mixture)
        self._set(maximisation(features, responsibilities))
        gain = float(expectation(features, self.mixture)[1] - before)
        self.log("train/nll", -before, on_epoch=True, on_step=False, batch_size=len(features))
        if gain < self.tolerance:
            self.trainer.should_stop = True

    def configure_optimizers(self) -> torch.optim.Optimizer | OptimizerLRSchedulerConfig:
        """Adam for SVI; for EM an optimizer whose step is the M step.

        The parameters have their final shape only once the number of clusters is known, so it is chosen here,
        which Lightning calls after a checkpoint was restored and before the first step.
        """
        if not self._restored:
            self._initialise()
        if self.training_method == "svi":
            return adam_with_cosine(self, self.learning_rate)
        return ClosedForm(self.parameters())

    def shape_from_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Make a program of as many clusters as the checkpoint has."""
        saved = next(v for k, v in checkpoint["state_dict"].items() if k.startswith("program.locs"))
        if saved.shape != self.program.locs.shape:
            self.program = MixtureProgram(*saved.shape).to(self.device)
        self._restored = True
