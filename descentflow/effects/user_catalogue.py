"""A user's own effects, from a Python file of theirs; the file is run."""

import inspect
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from descentflow.core.errors import ConfigError, DescentflowError
from descentflow.effects.effect import Effect

MODULE = "descentflow_user_effects"
"""Name under which the file is run."""


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
        ... class GustierAir(Effect):
        ...     name, says = "gustier_air", "air with more or fewer gusts"
        ...     parameters = (Parameter("ratio", -2.0, 2.0, "1", 0.2, shown_as="logarithm"),)
        ...     def shift(self, state, theta):
        ...         return {"noise_rate": theta[0].expand(len(state.cas_mps))}
        ... ''')
        >>> effects_of_file("own_effects.py")["gustier_air"].says
        'air with more or fewer gusts'
        >>> effects_of_file("own_effects.py", frozenset({"gustier_air"}))
        Traceback (most recent call last):
        ...
        descentflow.core.errors.ConfigError: own_effects.py: effect 'gustier_air', a name that is taken; ...
    """
    source = Path(path)
    if not source.is_file() or source.suffix != ".py":
        what = "no Python file" if source.is_file() else "no such file"
        raise ConfigError(f"{source}: {what}", expected="a Python file with effects", mend="name the file (.py)")
    module = _run(source)
    found: dict[str, Effect] = {}
    for effect in _effects(module, source):
        if effect.name in taken:
            raise ConfigError(
                f"{source}: effect {effect.name!r}, a name that is taken",
                expected="another name",
                mend="rename it; the names that are taken are those of descentflow.effects.EFFECTS",
            )
        if effect.name in found:
            raise ConfigError(
                f"{source}: two effects of the name {effect.name!r}", expected="a name for each", mend="rename one"
            )
        found[effect.name] = effect
    if not found:
        raise ConfigError(
            f"{source}: no effect",
            expected="a class that derives from descentflow.effects.Effect and has a `shift`, or an instance of one",
            mend="define one, as the tutorial 'Add an effect of your own' does",
        )
    return found


@contextmanager
def lines_named(source: str | Path | None) -> Iterator[None]:
    """Errors that the code of a user's file raises become errors that name its line.

    Args:
        source: The file; None for no file.

    Raises:
        ConfigError: In place of such an error.

    Example:
        >>> with lines_named(None):
        ...     1 / 0
        Traceback (most recent call last):
        ZeroDivisionError: division by zero
    """
    try:
        yield
    except DescentflowError:
        raise
    except Exception as error:
        if source is None or not _lines(Path(source), error):
            raise
        raise _failed(Path(source), error) from error


def _run(source: Path) -> ModuleType:
    """Run the file; an error names the file's own line."""
    spec = spec_from_file_location(MODULE, source)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    # Dataclasses and pickles of the file look for their module by its name.
    sys.modules[MODULE] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise _failed(source, error) from error
    return module


def _failed(source: Path, error: Exception) -> ConfigError:
    lines = _lines(source, error)
    line = error.lineno if isinstance(error, SyntaxError) else (lines[-1] if lines else None)
    place = f"{source}" if line is None else f"{source}, line {line}"
    message = error.msg if isinstance(error, SyntaxError) else str(error)
    return ConfigError(
        f"{place}: {type(error).__name__}: {message}", expected="a file that runs", mend="correct that line"
    )


def _lines(source: Path, error: Exception) -> list[int | None]:
    """Lines of a file that an error came through, the last one last."""
    frames = traceback.extract_tb(error.__traceback__)
    return [frame.lineno for frame in frames if Path(frame.filename).absolute() == source.absolute()]


def _effects(module: ModuleType, source: Path) -> list[Effect]:
    """Instances of the file, and one of each of its classes that has none."""
    values = list(vars(module).values())
    instances = list({id(v): v for v in values if isinstance(v, Effect) and type(v).__module__ == MODULE}.values())
    made = {type(effect) for effect in instances}
    for kind in dict.fromkeys(v for v in values if inspect.isclass(v) and issubclass(v, Effect)):
        if kind.__module__ != MODULE or inspect.isabstract(kind) or kind in made:
            continue
        try:
            instances.append(kind())
        except Exception as error:
            raise _failed(source, error) from error
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
