"""Training of the Gaussian mixture by EM or SVI, with as many components as AIC or BIC finds (paper, appendix C)."""

from math import inf
from typing import Any, Literal

import torch
from jsonargparse.typing import NonNegativeFloat, PositiveFloat, PositiveInt
from lightning.pytorch.utilities.types import OptimizerLRSchedulerConfig
from torch import Tensor

from descentflow.core.arguments import checked_arguments
from descentflow.core.progress import stage
from descentflow.densities.component_search import FLIGHTS_PER_PARAMETER, Criterion, select_mixture
from descentflow.densities.em import best_start, fit_mixture
from descentflow.densities.em_steps import Steps
from descentflow.densities.mixture import GaussianMixtureDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.densities.one_gaussian import drawn_weights, one_gaussian
from descentflow.training.models.latent_model import Batch, LatentModel, training_flights
from descentflow.training.models.optimizers import adam_with_cosine, no_steps

Training = Literal["em", "svi"]


class GaussianMixture(LatentModel[GaussianMixtureDensity]):
    """Trains a Gaussian mixture, see :class:`GaussianMixtureDensity`.

    Trained by expectation maximisation (``em``, the default: all of it in one epoch) or by stochastic variational
    inference with an enumerated ELBO (``svi``), on weights drawn given what was observed
    (:mod:`~descentflow.densities.one_gaussian`): once, or anew in each batch. ``train/nll`` is theirs. The number of
    components is chosen by an information criterion, unless it is set: by Akaike's, which asks what is most probable
    of flights not seen yet. Of few flights its mixtures are closer to held-out ones than those of the Bayesian
    criterion, the paper's, where covariances are shrunk towards the one that components share. Where flights are too
    few for two covariances, components that all have one are tried as well.

    Example:
        >>> from descentflow.training.fit import fit
        >>> fit("descents.parquet", GaussianMixture(n_clusters=2)).density.mixture.n_components
        2
    """

    @checked_arguments
    def __init__(
        self,
        n_clusters: PositiveInt | None = None,
        training: Training = "em",
        n_restarts: PositiveInt = 8,
        tolerance: PositiveFloat = 1e-6,
        learning_rate: PositiveFloat = 0.005,
        seed: int = 0,
        extend: bool = True,
        criterion: Criterion = "aic",
        prior_flights: NonNegativeFloat = 5.0,
    ) -> None:
        """Set the hyperparameters.

        Args:
            n_clusters: Number of mixture components; chosen by ``criterion`` if absent.
            training: ``em`` or ``svi``.
            n_restarts: k-means++ starts for each number of components; eight reach what fewer miss by 0.3 nats.
            tolerance: EM has converged when the mean log-likelihood gains less (nats per flight).
            learning_rate: Of Adam in ``svi``; larger steps throw narrow components off a good start.
            seed: Of the starts.
            extend: Try more components than 15 flights per parameter allow where the criterion decides for that cap,
                down to two flights per parameter, of many flights to 32 components; the paper stops at the cap.
            criterion: ``aic``, or ``bic`` as in the paper.
            prior_flights: Flights of the covariance that components share, added to each one's own
                (:mod:`descentflow.densities.em_steps`); zero for maximum likelihood. ``svi`` has it in the
                search for the number of components and in its start.
        """
        super().__init__()
        self.save_hyperparameters()
        self.training_method = training
        self.automatic_optimization = training == "svi"
        self.n_clusters, self.n_restarts, self.tolerance = n_clusters, n_restarts, tolerance
        # A built-in float: the optimizer's state keeps it, and a checkpoint holds primitives only.
        self.learning_rate, self.seed, self.extend = float(learning_rate), seed, extend
        self.criterion, self.prior_flights = criterion, float(prior_flights)
        self._restored = False
        self._gaussian: Mixture | None = None

    def choose_as(self, fitted: LatentModel[GaussianMixtureDensity]) -> None:
        """Take as many components as the other fit, and one covariance if that has one."""
        covariances = fitted.density.mixture.scale_trils
        self.n_clusters = len(covariances)
        if len(covariances) > 1 and bool((covariances == covariances[0]).all()):
            self.prior_flights = inf

    def make(self, dimension: int, n_context: int = 0) -> GaussianMixtureDensity:
        """A mixture of the number of components that was set, or of one until the criterion has chosen."""
        return GaussianMixtureDensity(dimension, self.n_clusters or 1, n_context)

    def _training_steps(self) -> Steps:
        """The steps of EM for weights of the training flights, drawn given what was observed of each."""
        evidence, context = training_flights(self)
        self._gaussian = one_gaussian(evidence, context)
        return Steps(drawn_weights(self._gaussian, evidence, self.seed, context), context, self.prior_flights)

    def _converged(self, steps: Steps) -> Mixture:
        """The mixture to which EM converges, of as many components as were set or the criterion chooses."""
        options: dict[str, Any] = {"seed": self.seed, "n_restarts": self.n_restarts, "tolerance": self.tolerance}
        if self.n_clusters is not None:
            return fit_mixture(steps, self.n_clusters, **options)[0]
        name = self.criterion.upper()
        with stage(f"choosing the number of components by {name}", unit="numbers") as tried:

            def show(most: int) -> None:
                tried.expect(most)
                tried.advance()

            options |= {"extend": self.extend, "criterion": self.criterion, "progress": show}
            selected = select_mixture(steps, **options)
            if selected.cap_binds and selected.mixture.n_components == 1 and steps.prior_flights:
                # Of components that share a covariance, flights allow more; two of their own are more probable.
                shared = select_mixture(Steps(steps.weights, steps.context, inf), **options)
                selected = min(selected, shared, key=lambda selection: min(selection.values.values()))
        limit = "largest number tried" if self.extend else f"cap of {FLIGHTS_PER_PARAMETER} flights per parameter"
        cap = f" (the {limit} decides: more components might fit better)" if selected.cap_binds else ""
        chosen = selected.mixture.n_components
        self.print(f"{name} chooses {chosen} of 1..{max(selected.values)} mixture components{cap}")
        return selected.mixture

    def training_step(self, batch: Batch, batch_index: int) -> Tensor | None:
        """All of EM at once, or the enumerated ELBO of a batch."""
        if self.training_method == "em":
            self._set_converged()
            return None
        if self._gaussian is None:
            self._gaussian = one_gaussian(*training_flights(self))
        weights = drawn_weights(self._gaussian, batch[0], self.seed_of_batch(batch_index), batch[1])
        with self.converging():
            loss = self.density.negative_elbo(weights, batch[1]) / len(weights)
        self.log("train/nll", loss, on_epoch=True, on_step=False, sync_dist=True, batch_size=len(weights))
        return loss

    @torch.no_grad()
    def _set_converged(self) -> None:
        steps = self._training_steps()
        self.density.mixture = self._converged(steps)
        train = steps.expectation(self.density.mixture)[1]
        self.log("train/nll", -train, on_epoch=True, on_step=False, sync_dist=True, batch_size=1)
        self.end_with_this_step()

    def on_train_end(self) -> None:
        """Let the Gaussian of the training flights go."""
        self._gaussian = None

    def configure_optimizers(self) -> torch.optim.Optimizer | OptimizerLRSchedulerConfig:
        """Adam for SVI; for EM one in name.

        Adam's parameters have their final shape only once the number of components is known, so it is chosen here,
        which Lightning calls after a checkpoint was restored and before the first step.
        """
        if self.training_method == "em":
            return no_steps(self)
        if not self._restored:
            steps = self._training_steps()
            n_components = self.n_clusters or self._converged(steps).n_components
            self.density.mixture = best_start(steps, n_components, seed=self.seed, n_restarts=self.n_restarts)
        return adam_with_cosine(self, self.learning_rate)

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """As every model, and do not look for a number of components again."""
        super().on_load_checkpoint(checkpoint)
        self._restored = True
