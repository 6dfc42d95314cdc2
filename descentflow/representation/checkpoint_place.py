"""Check that a checkpoint is where it should be, before anything heavy is imported."""

from pathlib import Path

from descentflow.core.errors import CheckpointError

MEND = "pass a .ckpt file that `descentflow fit` wrote, for instance runs/.../checkpoints/best.ckpt"


def check_is_there(path: str | Path) -> None:
    """Refuse a path that is no file; of a run's folder, or of that of its versions, the error names the checkpoint.

    Raises:
        CheckpointError: If there is no file.

    Example:
        >>> check_is_there("best.ckpt")
        >>> check_is_there("nothere.ckpt")
        Traceback (most recent call last):
        descentflow.core.errors.CheckpointError: no file nothere.ckpt; expected a checkpoint; to mend it, pass...
    """
    given = Path(path)
    if given.is_file():
        return
    inside = [
        path
        for run in (given, *sorted(given.glob("*/")))
        for name in ("best", "final")
        if (path := run / "checkpoints" / f"{name}.ckpt").is_file()
    ]
    raise CheckpointError(
        f"{given} is a folder" if given.is_dir() else f"no file {given}",
        expected="a checkpoint",
        mend=f"pass {inside[-1]}" if inside else MEND,
    )
