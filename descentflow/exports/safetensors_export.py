"""The model itself as safetensors, with a model card beside it."""

from pathlib import Path

from descentflow.core.files import whole_file
from descentflow.densities.checkpoint import content_of
from descentflow.exports.export_request import ExportRequest
from descentflow.exports.model_card import model_card
from descentflow.representation.safetensors_file import write_safetensors


def write(request: ExportRequest) -> list[Path]:
    """Write the model, which ``df.load`` and every command take as they take a checkpoint, and ``NAME.md``.

    A card that is there already is left as it is: somebody may have filled it in.

    Raises:
        ConfigError: If safetensors is not installed.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> _ = write(ExportRequest(load_model("best.ckpt"), Path("a320.safetensors")))
        >>> torch.equal(load_model("a320.safetensors").sample(5, seed=0), load_model("best.ckpt").sample(5, seed=0))
        True
    """
    write_safetensors(content_of(request.density), request.path)
    card = request.path.with_suffix(".md")
    if card.exists():
        return [request.path]
    with whole_file(card) as temporary:
        temporary.write_text(model_card(request.density, request.path.name), encoding="utf-8")
    return [request.path, card]
