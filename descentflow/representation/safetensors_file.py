"""Checkpoints as safetensors: named tensors and a JSON header, which any program can read and nothing executes."""

from pathlib import Path
from typing import Any

from descentflow.core.errors import CheckpointError
from descentflow.core.files import whole_file
from descentflow.core.tabular import optional_library
from descentflow.representation.tensor_tree import from_tensors_and_text, to_tensors_and_text

SUFFIX = ".safetensors"
HEADER = "descentflow"
"""Key of the file's metadata that holds everything but the tensors, as JSON."""


def write_safetensors(content: dict[str, Any], path: str | Path) -> None:
    """Write a checkpoint's content, whole or not at all.

    Raises:
        ConfigError: If safetensors is not installed.
        DataError: If the folder does not exist.

    Example:
        >>> write_safetensors({"w": torch.ones(2), "version": 1}, "w.safetensors")
        >>> read_safetensors("w.safetensors")
        {'w': tensor([1., 1.]), 'version': 1}
    """
    library = optional_library("safetensors.torch", extra="safetensors")
    tensors, text = to_tensors_and_text(content)
    with whole_file(path) as temporary:
        temporary.write_bytes(library.save(tensors, metadata={HEADER: text}))


def read_safetensors(path: str | Path) -> dict[str, Any]:
    """Read a checkpoint's content.

    Raises:
        CheckpointError: If the file is none, truncated, or not ours.
        ConfigError: If safetensors is not installed.

    Example:
        >>> Path("no.safetensors").write_bytes(b"nothing")
        7
        >>> read_safetensors("no.safetensors")
        Traceback (most recent call last):
        descentflow.core.errors.CheckpointError: no.safetensors: ...; expected a safetensors file of descentflow; ...
    """
    library = optional_library("safetensors", extra="safetensors")
    try:
        with library.safe_open(path, framework="pt") as file:
            header = (file.metadata() or {})[HEADER]
            return from_tensors_and_text({name: file.get_tensor(name) for name in file.keys()}, header)  # noqa: SIM118
    except (library.SafetensorError, KeyError, ValueError) as error:
        raise CheckpointError(
            f"{path}: {error}",
            expected="a safetensors file of descentflow",
            mend="write it again: descentflow export best.ckpt --to safetensors --out model.safetensors",
        ) from error
