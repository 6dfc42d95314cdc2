"""Pictures of tutorials: figures that the package returns are not pyplot's, so Sphinx-Gallery would not see them."""

from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


def scrape(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the ``figure`` of a block that made one, and return the text that shows it."""
    found = block_vars["example_globals"].get("figure")
    # Figures of pyplot are found by Sphinx-Gallery's own scraper, and have a number.
    if not isinstance(found, Figure) or hasattr(found, "number") or getattr(found, "shown_in_gallery", False):
        return ""
    found.shown_in_gallery = True  # type: ignore[attr-defined]
    path = next(block_vars["image_path_iterator"])
    found.savefig(path, dpi=110, bbox_inches="tight")
    return str(figure_rst([path], gallery_conf["src_dir"]))


def _get_sg_image_scraper() -> Callable[..., str]:
    return scrape
