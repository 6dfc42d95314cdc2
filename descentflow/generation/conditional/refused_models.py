"""Models that a generator for a running simulator does not take."""

from descentflow.representation.own_air import check_standard_air
from descentflow.representation.own_mass import check_reference_mass
from descentflow.representation.representation import Representation


def check_generates(representation: Representation) -> None:
    """Refuse a model whose descents a generator would fly in another air or at another mass.

    Raises:
        ConfigError: If its drag was inferred in the flights' own air or at their own mass.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> check_generates(load_representation("best.ckpt"))
    """
    what = "a generator of single descents"
    check_standard_air(representation, what)
    check_reference_mass(representation, what)
