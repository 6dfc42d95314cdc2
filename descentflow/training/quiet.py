"""Silence for advice of libraries that does not apply to this package."""

import logging
import os
import warnings

from descentflow.core.progress import clear_line

NO_ADVICE = ("TPU available", "GPU available: False", "`Trainer.fit` stopped", "\U0001f4a1 Tip")


def quiet() -> None:
    """Silence advice that does not apply here; other messages of Lightning still appear.

    Example:
        >>> quiet()
        >>> warnings.warn("The dataloader does not have many workers", stacklevel=1)  # prints nothing
    """
    # Lightning's own calls of jsonargparse are what is deprecated, not anything a user wrote.
    os.environ.setdefault("JSONARGPARSE_DEPRECATION_WARNINGS", "off")
    for advice in (
        ".*does not have many workers.*",  # the weights are in memory
        ".*The number of training batches.*",  # a closed form has few
        ".*LightningCLI's args parameter.*",  # descentflow's own command line calls it
        ".*treespec, LeafSpec.*",
        ".*callbacks used to create the checkpoint need to be provided.*",  # what stops a fit is no matter of a score
        ".*The dirpath has changed.*",  # test and predict write into a folder of their own
    ):
        warnings.filterwarnings("ignore", message=advice)
    for handler in logging.getLogger("lightning.pytorch").handlers:
        handler.addFilter(_is_no_advice)


def _is_no_advice(record: logging.LogRecord) -> bool:
    # What is said goes where the progress is shown.
    clear_line()
    return not record.getMessage().startswith(NO_ADVICE)
