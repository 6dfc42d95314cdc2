"""Bases of results: what a notebook and a prompt show of them, the axes of their figure, and their table."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from markupsafe import escape

from descentflow.core.errors import DataError
from descentflow.core.tabular import to_pandas

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 70
"""Of the figure: a column of a notebook is some 900 pixels wide."""


class InNotebook(ABC):
    """A result that a notebook shows as a figure with the printed lines below.

    Example:
        >>> from matplotlib.figure import Figure
        >>> class Answer(InNotebook):
        ...     def notebook_figure(self):
        ...         return Figure(figsize=(2, 1))
        ...
        ...     def __str__(self):
        ...         return "42 < 43"
        >>> shown = Answer()._repr_html_()
        >>> shown.startswith("<figure>"), shown.endswith("<pre>42 &lt; 43</pre>")
        (True, True)
    """

    @abstractmethod
    def notebook_figure(self) -> "Figure | None":
        """The figure; None where there is nothing to draw."""

    def plot(self) -> "list[Axes]":
        """Draw the figure that a notebook shows.

        Returns:
            Its axes, to be changed or added to; ``axes[0].figure`` is the figure, which has ``savefig``.

        Raises:
            DataError: If there is nothing to draw.

        Example:
            >>> from descentflow.surveillance.rows.drop_report import DropReport, Step
            >>> axes = DropReport([Step("transient", 8, 0, 90, 3)]).plot()
            >>> axes[0].get_xlabel()
            'Rows dropped'
        """
        figure = self.notebook_figure()
        if figure is None:
            name = type(self).__name__
            raise DataError(f"a {name} with nothing to draw", expected="one that has something", mend="print it")
        return list(figure.axes)

    def _repr_html_(self) -> str:
        """Figure and printed lines."""
        # Templates and matplotlib are imported when something is shown, not when something is computed.
        from descentflow.reporting.pages import figure

        picture = self.notebook_figure()
        drawn = "" if picture is None else figure(picture, f"Figure of the {type(self).__name__}", dpi=DPI)
        return f"{drawn}<pre>{escape(str(self))}</pre>"

    def __repr__(self) -> str:
        """As printed."""
        return str(self)


class WithTable(InNotebook):
    """A result that is a table as well.

    Example:
        >>> import descentflow as df
        >>> len(df.sample("best.ckpt", 2, seed=0).to_pandas()["sample_id"].unique())
        2
    """

    @abstractmethod
    def to_polars(self) -> "pl.DataFrame":
        """The table."""

    def to_pandas(self) -> Any:
        """The table as a `pandas.DataFrame`.

        Raises:
            ConfigError: If pandas is not installed.
        """
        return to_pandas(self.to_polars())
