"""One Gaussian over the weights (paper, section 2.3 and appendix C)."""

import torch
from torch import Tensor

from descentflow.densities.gaussian import GaussianDensity
from descentflow.models.base import LatentModel
from descentflow.models.optimizers import ClosedForm


class Gaussian(LatentModel[GaussianDensity]):
    """The maximum-likelihood Gaussian: mean and full covariance, gathered over one epoch.

    ``log p(w) = log N(w; loc, scale_tril scale_tril')``

    Example:
        >>> Trainer(max_epochs=1).fit(Gaussian(), datamodule=data)
    """

    def __init__(self, jitter: float = 1e-6) -> None:
        """Set the one option.

        Args:
            jitter: Added to the variances of the standardised weights; scikit-learn's ``reg_covar``.
        """
        super().__init__()
        self.save_hyperparameters()
        self.automatic_optimization = False
        self.jitter = jitter

    def make(self, dimension: int) -> GaussianDensity:
        """A standard normal of the dimension."""
        return GaussianDensity(dimension)

    def on_train_epoch_start(self) -> None:
        """Forget the moments of the last epoch."""
        density = self.density
        self._count, self._sum = 0, torch.zeros_like(density.loc)
        self._outer = torch.zeros_like(density.scale_tril)

    def training_step(self, batch: tuple[Tensor, ...], batch_index: int) -> None:
        """Gather count, sum and second moments of a batch; set the parameters after the epoch's last one."""
        weights = batch[0].to(self.density.loc.dtype)
        self._count += len(weights)
        self._sum += weights.sum(0)
        self._outer += weights.T @ weights
        # Not in on_train_epoch_end: Lightning validates, and saves the best checkpoint, before that hook.
        if self.trainer.is_last_batch:
            self.optimizers().step(closure=self._maximise)  # type: ignore[union-attr]
            # Another epoch would gather the same moments.
            self.trainer.should_stop = True

    @torch.no_grad()
    def _maximise(self) -> None:
        mean = self._sum / self._count
        covariance = self._outer / self._count - torch.outer(mean, mean)
        covariance.diagonal().add_(self.jitter)
        self.density.loc.copy_(mean)
        self.density.scale_tril.copy_(torch.linalg.cholesky(covariance))

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """An optimizer whose step is the closed form."""
        return ClosedForm(self.parameters())
