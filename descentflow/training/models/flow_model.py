"""Training of a flow by maximum likelihood (paper, section 2.3 and appendix C)."""

import warnings
from dataclasses import asdict
from typing import Any

import torch
from jsonargparse.typing import PositiveFloat, PositiveInt
from lightning.pytorch.utilities.types import OptimizerLRSchedulerConfig
from torch import Tensor

from descentflow.core.arguments import checked_arguments
from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.densities.flow import MaskedAffineFlowDensity
from descentflow.densities.importance import estimate, widened
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.one_gaussian import one_gaussian
from descentflow.training.models.latent_model import Batch, LatentModel, training_flights
from descentflow.training.models.optimizers import FlowSteps, adam_with_cosine

BEST = "best_epoch"
"""Key of a checkpoint under which a flow's best epoch is kept next to the last one."""
FEWEST_FLIGHTS = 2
"""Training flights a weight that a whitened flow needs to be more than its Gaussian: with fewer, the two or three
flights that validate it let epochs pass of which up to a fifth of the draws are not plausible."""
VALIDATION_DRAWS = 32
"""Of each validation flight's weights after an epoch: the same ones every time, so that epochs compare."""


class MaskedAffineFlow(LatentModel[MaskedAffineFlowDensity]):
    """Trains masked affine flows; see :class:`MaskedAffineFlowDensity`.

    A whitened flow is its Gaussian in the first epoch, which trains nothing, so that the best epoch may be that one.
    The best epoch is chosen by ``val/bound``: the NLL of the validation flights plus ``caution`` standard
    errors of its difference from the Gaussian's. With few flights a gain must be larger to be believed.

    Example:
        >>> from descentflow.training.fit import fit
        >>> fit("descents.parquet", MaskedAffineFlow(n_flows=2), max_epochs=2).density.settings()["n_flows"]
        2
    """

    @checked_arguments
    def __init__(
        self,
        n_flows: PositiveInt = 5,
        hidden_per_weight: PositiveInt = 2,
        learning_rate: PositiveFloat = 3e-3,
        whitened: bool = True,
        linear: bool = True,
        turned_round: bool = True,
        **steps: Any,
    ) -> None:
        """Set the hyperparameters.

        Args:
            n_flows: Number of masked affine flows.
            hidden_per_weight: Hidden units of each flow, as a multiple of the number of weights.
            learning_rate: Of Adam, annealed to zero by a cosine that ends with the last epoch.
            whitened: Start from the Gaussian of the training flights.
            linear: LU-decomposed maps between the flows.
            turned_round: One pass of the networks for a density, not one a weight; see the density.
            **steps: Of training, by the names of :class:`~.optimizers.FlowSteps`.
        """
        super().__init__()
        self.save_hyperparameters()
        self.steps = FlowSteps(**steps)
        self.hparams.update(asdict(self.steps))
        self._restored = False
        self._by_flight: list[Tensor] = []
        self._wide: Mixture | None = None
        self._best: tuple[float, dict[str, Tensor]] | None = None

    def make(self, dimension: int, n_context: int = 0) -> MaskedAffineFlowDensity:
        """Flows that start at the identity or its neighbourhood."""
        options = {name: self.hparams[name] for name in ("whitened", "linear", "turned_round")}
        sizes = int(self.hparams["n_flows"]), int(self.hparams["hidden_per_weight"])
        return MaskedAffineFlowDensity(dimension, *sizes, n_context, **options)

    def training_step(self, batch: Batch, batch_index: int) -> Tensor:
        """Negative log-likelihood of what was observed of a batch.

        Where weights are not known, of each flight some are drawn given what was observed, under a Gaussian wider than
        the flow: others in every epoch, and each counts by its importance (:mod:`descentflow.densities.importance`).
        """
        evidence, context = batch
        if evidence.known:
            loss = self.nll(batch)
        else:
            seed = self.seed_of_batch(batch_index)
            n_draws = int(self.steps.n_draws)
            drawn = estimate(self.density.log_prob, self._proposing(), evidence, n_draws, context, seed)
            loss = -drawn.log_prob.mean()
            self.log(
                "train/effective",
                drawn.effective.mean(),
                on_epoch=True,
                on_step=False,
                sync_dist=True,
                batch_size=len(evidence),
            )
        self.log("train/nll", loss, on_epoch=True, on_step=False, sync_dist=True, batch_size=len(evidence))
        return loss

    def validation_step(self, batch: Batch, batch_index: int) -> None:
        """As every model, and keep each flight's gain over the Gaussian.

        ``val/effective`` is the mean share of effective draws behind the estimates; one where weights are known.
        """
        evidence, context = batch
        if evidence.known:
            log_prob = self.log_observed(*batch)
        else:
            drawn = self.density.estimate_observed(evidence, context, self._proposing(), VALIDATION_DRAWS)
            log_prob = drawn.log_prob
            self.log("val/effective", drawn.effective.mean(), on_epoch=True, sync_dist=True, batch_size=len(evidence))
        self.log("val/nll", -log_prob.mean(), prog_bar=True, on_epoch=True, sync_dist=True, batch_size=len(log_prob))
        base = self.density.base_log_observed(*batch) if self.density.whitened else torch.zeros_like(log_prob)
        self._by_flight.append(torch.stack([log_prob.double(), base.double()]))

    def on_validation_epoch_start(self) -> None:
        """As every model, but where training has diverged go back to the best epoch and end with it."""
        try:
            super().on_validation_epoch_start()
        except ConfigError as error:
            if self._best is None:
                raise
            self.density.load_state_dict(self._best[1])
            self.trainer.should_stop = True
            best = f"the fit ends with the best epoch before, of val/bound {self._best[0]:.4g}"
            warnings.warn(f"{error}; {best}", DescentflowWarning, stacklevel=2)

    def _proposing(self) -> Mixture:
        """The wide Gaussian of the training flights, made once."""
        if self._wide is None:
            gaussian = self.density.base_gaussian() if self.density.whitened else one_gaussian(*training_flights(self))
            self._wide = widened(gaussian)
        return self._wide

    def on_validation_epoch_end(self) -> None:
        """Log ``val/bound``, and keep the parameters of the best epoch so far."""
        log_prob, base = torch.cat(self._by_flight, 1)
        self._by_flight = []
        error = (log_prob - base).std() / len(base) ** 0.5 if self.density.whitened and len(base) > 1 else 0.0
        bound = -log_prob.mean() + self.steps.caution * error
        self.log("val/bound", bound, sync_dist=True, batch_size=len(base))
        counts = self.trainer.state.fn == "fit" and not self.trainer.sanity_checking
        if counts and (self._best is None or float(bound) < self._best[0]):
            self._best = float(bound), {k: v.detach().clone() for k, v in self.density.state_dict().items()}

    def on_train_end(self) -> None:
        """Go back to the best epoch."""
        if self._best is not None:
            self.density.load_state_dict(self._best[1])

    def configure_optimizers(self) -> OptimizerLRSchedulerConfig:
        """AdamW with a cosine that ends with the last epoch; before it, the Gaussian of the training flights."""
        evidence, context = training_flights(self)
        if self.density.whitened and not self._restored:
            one = one_gaussian(evidence, context)
            self.density.whiten(one.locs[0], one.slopes[0], one.scale_trils[0])
        # Built-in floats: the optimizer's state keeps them, and a checkpoint holds primitives only.
        decay = float(self.steps.weight_decay + self.steps.shrinkage / len(evidence))
        few = self.density.whitened and len(evidence) < FEWEST_FLIGHTS * self.density.dimension
        if few:
            self._stay(len(evidence))
        rate = 0.0 if few else float(self.hparams["learning_rate"])
        return adam_with_cosine(self, rate, decay, still_first=self.density.whitened, max_steps=self.steps.max_steps)

    def _stay(self, n_flights: int) -> None:
        """End the fit with the Gaussian, and say why."""
        self.trainer.fit_loop.max_epochs = 1
        warnings.warn(
            f"{n_flights} training flights for a flow of {self.density.dimension} weights: it stays the Gaussian that "
            f"it starts from; to mend it, prepare more descents ({FEWEST_FLIGHTS} a weight at least) or fit a Gaussian",
            DescentflowWarning,
            stacklevel=2,
        )

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """As every model, with the best epoch so far for a fit that is resumed."""
        super().on_save_checkpoint(checkpoint)
        if self._best is not None:
            checkpoint[BEST] = {"bound": self._best[0], "state_dict": self._best[1]}

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """As every model, and keep the Gaussian and the best epoch of the checkpoint."""
        super().on_load_checkpoint(checkpoint)
        self._restored = True
        if BEST in checkpoint:
            self._best = float(checkpoint[BEST]["bound"]), dict(checkpoint[BEST]["state_dict"])
