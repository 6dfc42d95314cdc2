"""One Gaussian over the weights (paper, section 2.3 and appendix C), its mean regressed on a context if any."""

import torch
from jsonargparse.typing import ClosedUnitInterval, NonNegativeFloat

from descentflow.core.arguments import checked_arguments
from descentflow.densities.em_steps import RIDGE
from descentflow.densities.gaussian import GaussianDensity
from descentflow.densities.one_gaussian import one_gaussian
from descentflow.training.models.latent_model import Batch, LatentModel, training_flights
from descentflow.training.models.optimizers import no_steps


class Gaussian(LatentModel[GaussianDensity]):
    """The maximum-likelihood Gaussian: mean and full covariance, set in one epoch.

    ``log p(w) = log N(w; loc, scale_tril scale_tril')``; with a context, ridge regression of the mean on it and
    the covariance of the residuals. The likelihood is that of what was observed
    (:func:`~descentflow.densities.one_gaussian.one_gaussian`); with ``data.gaps: filled`` the weights count as known,
    and mean and covariance are theirs.

    Example:
        >>> from descentflow.training.fit import fit
        >>> density = fit("descents.parquet", Gaussian()).density
        >>> bool(density.scale_tril.norm(dim=1).max() > 1)  # wider than expected weights, whose deviation is one
        True
    """

    @checked_arguments
    def __init__(self, jitter: ClosedUnitInterval = 1e-6, ridge: NonNegativeFloat = RIDGE) -> None:
        """Set the options.

        Args:
            jitter: Added to the variances of the standardised weights; scikit-learn's ``reg_covar``.
            ridge: Number of flights at one standard deviation of context that the prior of zero slopes counts as.
        """
        super().__init__()
        self.save_hyperparameters()
        self.automatic_optimization = False
        self.jitter, self.ridge = float(jitter), float(ridge)

    def make(self, dimension: int, n_context: int = 0) -> GaussianDensity:
        """A standard normal of the dimension."""
        return GaussianDensity(dimension, n_context)

    @torch.no_grad()
    def training_step(self, batch: Batch, batch_index: int) -> None:
        """Set the parameters in closed form, or by the EM of one Gaussian, from all training flights."""
        evidence, context = training_flights(self)
        self.density.mixture = one_gaussian(evidence, context, ridge=self.ridge, jitter=self.jitter)
        train = self.log_observed(evidence, context)
        self.log("train/nll", -train.mean(), on_epoch=True, on_step=False, sync_dist=True, batch_size=len(evidence))
        self.end_with_this_step()

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """One in name."""
        return no_steps(self)
