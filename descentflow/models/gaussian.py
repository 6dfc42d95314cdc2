"""One Gaussian over the weights (paper, section 2.3 and appendix C)."""

import torch
from torch import Tensor, nn

from descentflow.models.base import LatentModel
from descentflow.models.optimizers import ClosedForm


class Gaussian(LatentModel):
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

    def build(self, dimension: int) -> None:
        """A standard normal of the dimension."""
        self.loc = nn.Parameter(torch.zeros(dimension, dtype=torch.float64))
        self.scale_tril = nn.Parameter(torch.eye(dimension, dtype=torch.float64))

    @property
    def distribution(self) -> torch.distributions.MultivariateNormal:
        """The density as a torch distribution."""
        return torch.distributions.MultivariateNormal(self.loc, scale_tril=self.scale_tril, validate_args=False)

    def log_prob(self, weights: Tensor) -> Tensor:
        """Log density (n,) of standardised weights (n, d)."""
        log_prob: Tensor = self.distribution.log_prob(weights.to(self.loc.dtype))  # type: ignore[no-untyped-call]
        return log_prob

    def draw(self, n: int) -> Tensor:
        """Draw (n, d)."""
        return self.distribution.sample((n,))

    def on_train_epoch_start(self) -> None:
        """Forget the moments of the last epoch."""
        self._count, self._sum, self._outer = 0, torch.zeros_like(self.loc), torch.zeros_like(self.scale_tril)

    def training_step(self, batch: tuple[Tensor, ...], batch_index: int) -> None:
        """Gather count, sum and second moments of a batch; set the parameters after the epoch's last one."""
        weights = batch[0].to(self.loc.dtype)
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
        self.loc.copy_(mean)
        self.scale_tril.copy_(torch.linalg.cholesky(covariance))

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """An optimizer whose step is the closed form."""
        return ClosedForm(self.parameters())
