"""Tasks in processes of this machine, as the package runs them in threads or on a Dask cluster."""

import os
import threading
import time

from descentflow.core.workers import Engine


def processes(workers: int) -> Engine:
    """Processes of this machine, begun afresh; with one worker this process itself, one task after another.

    For work that draws, trains or prints, which threads of one process cannot do at the same time.

    Example:
        >>> done = []
        >>> for _ in processes(1).run(lambda task, common: done.append(task), ["a", "b"], None):
        ...     pass
        >>> done
        ['a', 'b']
    """
    return Engine(workers, "loky", options={"initializer": alone})


def alone() -> None:
    """Let a worker keep to one thread, and end when the process that began it is killed; it would go on working."""
    import torch

    torch.set_num_threads(1)
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.2)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
