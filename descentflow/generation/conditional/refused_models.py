"""Models that a generator for a running simulator does not take."""

from descentflow.core.errors import ConfigError
from descentflow.representation.own_air import check_standard_air
from descentflow.representation.own_mass import check_reference_mass
from descentflow.representation.representation import Representation


def check_generates(representation: Representation) -> None:
    """Refuse a model whose descents a generator cannot condition, or would fly in another air or at another mass.

    Raises:
        ConfigError: If its CAS is not linear in its weights, so that conditions on it have no closed form; or its drag
            was inferred in the flights' own air or at their own mass.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> check_generates(load_representation("best.ckpt"))
    """
    if representation.decoder.speed != "cas":
        raise ConfigError(
            "a model of speed as a Mach number and a CAS (data.speed: mach_cas), the lower of which is flown",
            expected="a model of one CAS profile (data.speed: cas), on which conditions have a closed form",
            mend="fit with --data.speed cas, or draw samples (descentflow sample) and keep those that meet them",
        )
    what = "a generator of single descents"
    check_standard_air(representation, what)
    check_reference_mass(representation, what)
