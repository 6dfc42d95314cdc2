"""A user's own effects, from a Python file of theirs; the file is run."""

import inspect
from pathlib import Path
from types import ModuleType

from descentflow.core.errors import ConfigError
from descentflow.core.user_files import failed, module_of_file
from descentflow.effects.effect import Effect


def effects_of_file(path: str | Path, taken: frozenset[str] = frozenset()) -> dict[str, Effect]:
    """The effects that a file defines: its subclasses of :class:`~descentflow.effects.effect.Effect`, and instances.

    Of a class that needs arguments the file makes the instances; a class without ``shift`` is a base of others.

    Args:
        path: Of a Python file. **It is run.**
        taken: Names that are taken already.

    Returns:
        Effects by their names, in the file's order.

    Raises:
        ConfigError: If there is no such file, it fails, it holds no effect, or a name is taken or stands for two.

    Example:
        >>> _ = Path("own_effects.py").write_text('''
        ... from descentflow.effects import Effect, Parameter
        ... class Ice(Effect):
        ...     name, description = "ice", "more or less drag by ice"
        ...     parameters = (Parameter("drag", -0.2, 0.5, "1", 0.05),)
        ...     def shift(self, state, theta):
        ...         return {"rate": theta[0] * (state.altitude_m < 6000).expand_as(state.cas_mps)}
        ... ''')
        >>> effects_of_file("own_effects.py")["ice"].description
        'more or less drag by ice'
        >>> effects_of_file("own_effects.py", frozenset({"ice"}))
        Traceback (most recent call last):
        ...
        descentflow.core.errors.ConfigError: own_effects.py: effect 'ice', a name that is taken; ...
    """
    source, module = Path(path), module_of_file(path, "effects")
    effects: dict[str, Effect] = {}
    for effect in _effects(module, source):
        if effect.name in taken:
            raise ConfigError(
                f"{source}: effect {effect.name!r}, a name that is taken",
                expected="another name",
                mend="rename it; the names that are taken are those of descentflow.effects.EFFECTS",
            )
        if effect.name in effects:
            raise ConfigError(
                f"{source}: two effects of the name {effect.name!r}", expected="a name for each", mend="rename one"
            )
        effects[effect.name] = effect
    if not effects:
        raise ConfigError(
            f"{source}: no effect",
            expected="a class that derives from descentflow.effects.Effect and has a `shift`, or an instance of one",
            mend="define one, as the tutorial 'Add an effect of your own' does",
        )
    return effects


def _effects(module: ModuleType, source: Path) -> list[Effect]:
    """Instances of the file, and one of each of its classes that has none."""
    own, values = module.__name__, list(vars(module).values())
    instances = list({id(v): v for v in values if isinstance(v, Effect) and type(v).__module__ == own}.values())
    made = {type(effect) for effect in instances}
    for kind in dict.fromkeys(v for v in values if inspect.isclass(v) and issubclass(v, Effect)):
        if kind.__module__ != own or inspect.isabstract(kind) or kind in made:
            continue
        try:
            instances.append(kind())
        except Exception as error:
            raise failed(source, error) from error
    for effect in instances:
        if not isinstance(getattr(effect, "name", None), str) or not isinstance(
            getattr(effect, "parameters", None), tuple
        ):
            raise ConfigError(
                f"{source}: class {type(effect).__name__} without `name` and `parameters`",
                expected="a name, and a tuple of Parameter",
                mend="state both in the class",
            )
    return instances
