"""One Gaussian over the weights (paper, section 2.3 and appendix C), its mean regressed on a context if any."""

import torch
from jsonargparse.typing import NonNegativeFloat
from torch import Tensor

from descentflow.densities.gaussian import GaussianDensity
from descentflow.densities.regression_steps import RIDGE
from descentflow.training.models.latent_model import LatentModel
from descentflow.training.models.optimizers import ClosedForm


class Gaussian(LatentModel[GaussianDensity]):
    """The maximum-likelihood Gaussian: mean and full covariance, gathered over one epoch.

    ``log p(w) = log N(w; loc, scale_tril scale_tril')``; with a context, ridge regression of the mean on it and
    the covariance of the residuals.

    Example:
        >>> from descentflow.training.fit import fit
        >>> density = fit("descents.parquet", Gaussian()).density
        >>> bool(density.loc.abs().max() < 1e-6)  # the weights of the training flights are standardised
        True
    """

    def __init__(self, jitter: float = 1e-6, ridge: NonNegativeFloat = RIDGE) -> None:
        """Set the options.

        Args:
            jitter: Added to the variances of the standardised weights; scikit-learn's ``reg_covar``.
            ridge: Number of flights at one standard deviation of context that the prior of zero slopes counts as.
        """
        super().__init__()
        self.save_hyperparameters()
        self.automatic_optimization = False
        self.jitter, self.ridge = jitter, float(ridge)

    def make(self, dimension: int, n_context: int = 0) -> GaussianDensity:
        """A standard normal of the dimension."""
        return GaussianDensity(dimension, n_context)

    def on_train_epoch_start(self) -> None:
        """Forget the moments of the last epoch."""
        # Weights and context are gathered together: the regression is in their joint moments.
        density = self.density
        self._count, self._sum = 0, density.loc.new_zeros(density.dimension + density.n_context)
        self._outer = torch.outer(self._sum, self._sum)

    def training_step(self, batch: tuple[Tensor, ...], batch_index: int) -> None:
        """Gather count, sum and second moments of a batch; set the parameters after the epoch's last one."""
        both = torch.cat([part.to(self.density.loc.dtype) for part in batch], 1)
        self._count += len(both)
        self._sum += both.sum(0)
        self._outer += both.T @ both
        # Not in on_train_epoch_end: Lightning validates, and saves the best checkpoint, before that hook.
        if self.trainer.is_last_batch:
            self.optimizers().step(closure=self._maximise)  # type: ignore[union-attr]
            # Another epoch would gather the same moments.
            self.trainer.should_stop = True

    @torch.no_grad()
    def _maximise(self) -> None:
        mean = self._sum / self._count
        covariance = self._outer / self._count - torch.outer(mean, mean)
        d = self.density.dimension
        loc, spread = mean[:d], covariance[:d, :d]
        if self.density.n_context:
            across, inner = covariance[:d, d:], covariance[d:, d:]
            eye = torch.eye(len(inner)).to(inner)
            slope = torch.linalg.solve(inner + self.ridge / self._count * eye, across.T).T
            loc = loc - slope @ mean[d:]
            spread = spread - slope @ across.T - across @ slope.T + slope @ inner @ slope.T
            self.density.slope.copy_(slope)
        spread = spread.clone()
        spread.diagonal().add_(self.jitter)
        self.density.loc.copy_(loc)
        self.density.scale_tril.copy_(torch.linalg.cholesky(spread))

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """An optimizer whose step is the closed form."""
        return ClosedForm(self.parameters())
