"""A density of the user's own with the LightningModule that trains it, from a Python file of theirs."""

import inspect
from pathlib import Path
from typing import Any

from descentflow.core.errors import ConfigError
from descentflow.core.user_files import module_of_file
from descentflow.densities import MODULES
from descentflow.densities.density import Density
from descentflow.training import models
from descentflow.training.models.latent_model import LatentModel


def model_of_file(path: str | Path) -> type[LatentModel[Any]]:
    """The model that a file defines: its one subclass of :class:`.LatentModel` that is not abstract.

    Args:
        path: Of a Python file, which is run. Its densities are known to checkpoints from then on.

    Raises:
        ConfigError: If there is no such file, it fails, or it has no model, several, or a name that is taken.

    Example:
        >>> _ = Path("own_density.py").write_text('''
        ... from descentflow.densities.gaussian import GaussianDensity
        ... from descentflow.training.models.gaussian_model import Gaussian
        ... class NarrowDensity(GaussianDensity):
        ...     pass
        ... class Narrow(Gaussian):
        ...     def make(self, dimension, n_context=0):
        ...         return NarrowDensity(dimension, n_context)
        ... ''')
        >>> model_of_file("own_density.py").__name__
        'Narrow'
        >>> _ = Density.kinds.pop("NarrowDensity")  # it shall not be known to other examples
    """
    before = dict(Density.kinds)
    try:
        return _only_model(path)
    except ConfigError:
        for name in Density.kinds.keys() - before.keys():
            del Density.kinds[name]
        Density.kinds.update(before)  # a name of the package that the file took is the package's again
        raise


def _only_model(path: str | Path) -> type[LatentModel[Any]]:
    module = module_of_file(path, "a density and its model")
    own = [kind for kind in vars(module).values() if inspect.isclass(kind) and kind.__module__ == module.__name__]
    kinds = [kind for kind in own if issubclass(kind, LatentModel) and not inspect.isabstract(kind)]
    taken = [kind.__name__ for kind in own if kind.__name__ in {*MODULES, *models.MODULES}]
    if taken or len(kinds) != 1:
        what = f"{taken[0]}, a name that is taken" if taken else f"{len(kinds) or 'no'} models"
        raise ConfigError(
            f"{path}: {what}",
            expected="one class that derives from descentflow.training.models.LatentModel, with a name of its own",
            mend="rename it" if taken else "keep one model in a file, as the page on densities does",
        )
    return kinds[0]
