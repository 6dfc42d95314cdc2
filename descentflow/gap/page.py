"""gap.html."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from descentflow.gap.report import GapReport


def page(report: "GapReport") -> str:
    """One self-contained page."""
    return f"<pre>{report}</pre>"
