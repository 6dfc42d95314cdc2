"""Learning of how training flights differ by their entry level, for a trained density."""

from typing import Any

from descentflow.densities.entry_law import EntryLaw
from descentflow.densities.learn_entry_law import learn_entry_law
from descentflow.training.datamodule import data_of
from descentflow.training.models.latent_model import LatentModel, training_flights


def entry_law_of(model: LatentModel[Any]) -> EntryLaw | None:
    """The law of the normals behind a Gaussian or a flow, with the density as it is; None with a context.

    Example:
        >>> from descentflow.training.fit import fit
        >>> law = fit("descents.parquet", "gaussian").density.entry_law
        >>> law is None or len(law.shares) > 1
        True
    """
    evidence, context = training_flights(model)
    entry = data_of(model.trainer).entries("train")
    return None if context is not None or entry is None else learn_entry_law(model.density, evidence, entry)
