"""The parameters of attacks: the keyword-only arguments of their constructors, with defaults and types."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar, cast, get_type_hints

from pydantic import TypeAdapter, ValidationError

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.section import leaves, parse_share, written_number
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.scenario.attacks import AttackSpec, Value
from advpipe.stages.attack.base import Attack, PublishedPreset

A = TypeVar("A", bound=Attack)

PRESET = "preset"
"""A parameter of every attack with presets: the name of one."""

REQUIRED = inspect.Parameter.empty

MAX_BY_UNIT: dict[str, float] = {
    "m": 1e6,  # farther than any map
    "cm": 1e4,
    "s": 1e6,  # longer than any drive
    "mps": 1e4,
    "mps2": 1e3,
    "hz": 1e5,  # more than any radio sends
    "deg": 1e4,
    "degps": 1e5,
}
"""The largest magnitude of a parameter, by the unit that its name ends in."""

SHARES = ("ratio", "share", "probability")
"""The last words of the names of parameters that are shares of a whole: 1% may be written for 0.01."""

MAX_WITHOUT_UNIT = 1e6
"""Of counts, shares, factors and weights: a million rounds for each cloud would take days."""


def known_parameters(attack_class: type[Attack]) -> dict[str, Any]:
    """The parameters of an attack but for its recipe, in their order, with their defaults or `REQUIRED`."""
    return {name: one.default for name, one in _keywords(attack_class).items() if name != "recipe"}


def is_share(name: str) -> bool:
    """Whether a parameter of this name is a share of a whole, and may be given in percent."""
    return name.rpartition("_")[2] in SHARES


def parameter_types(attack_class: type[Attack]) -> dict[str, tuple[Any, ...]]:
    """By name, the types of a value, or of a list's items; a user's attack may declare none."""
    types = _types(attack_class)
    return {name: tuple(leaves(types[name])) for name in known_parameters(attack_class) if name in types}


def resolved_parameters(spec: AttackSpec, attack_class: type[Attack]) -> dict[str, Any]:
    """All parameters of an attack of this class, in the constructor's order, with defaults if not given,
    those of its preset, if it names one, which comes first.

    Raises AdvpipeError for one that is unknown, missing or of another type; the constructor checks bounds.
    """
    preset = preset_of(spec, attack_class)
    own = {PRESET: spec.parameters[PRESET]} if preset is not None else {}
    attack_class = preset_class(spec, attack_class)
    known = known_parameters(attack_class) | dict(preset.parameters if preset is not None else {})
    for name in spec.parameters.keys() - own.keys():
        if name not in known:
            choice = known_names(name, known) if known else "it has none"
            raise UsageError(f"{spec.type}: unknown parameter {short_repr(name)}; {choice}")
    for name, default in known.items():
        if default is REQUIRED and name not in spec.parameters:
            raise UsageError(f"{spec.type}: {name} is missing; pass {option_name(name)}")
    types = _types(attack_class)
    given = {
        name: _checked(spec.type, name, value, types)
        for name, value in spec.parameters.items()
        if name not in own
    }
    return own | {name: given.get(name, default) for name, default in known.items()}


def preset_of(spec: AttackSpec, attack_class: type[Attack]) -> PublishedPreset | None:
    """The published preset that the attack's parameters name; None for none.

    Raises AdvpipeError for one that the attack does not have.
    """
    presets = vars(attack_class).get("presets", {})
    if not presets or PRESET not in spec.parameters:
        return None
    name = spec.parameters[PRESET]
    if not isinstance(name, str) or name not in presets:
        raise UsageError(f"{spec.type}: unknown preset {short_repr(name)}; {known_names(str(name), presets)}")
    found: PublishedPreset = presets[name]
    return found


def preset_class(spec: AttackSpec, attack_class: type[A]) -> type[A]:
    """The class that carries out the attack: that of its preset, or else its own."""
    preset = preset_of(spec, attack_class)
    if preset is None or preset.attack_class is None:
        return attack_class
    return cast("type[A]", preset.attack_class)


def resolved_recipe(spec: AttackSpec, attack_class: type[Attack]) -> str:
    """The attack's recipe: by default its best one; "" for an attack without recipes."""
    recipe = _keywords(attack_class).get("recipe")
    if recipe is None and spec.recipe is not None:
        raise UsageError(f"{spec.type} has no recipes; leave out {short_repr(spec.recipe)}")
    if spec.recipe == "":
        raise UsageError(f"{spec.type}: the recipe is empty; name one, or leave it out")
    if recipe is None:
        return ""
    return str(recipe.default) if spec.recipe is None else spec.recipe


def _keywords(attack_class: type[Attack]) -> Mapping[str, inspect.Parameter]:
    keywords: dict[str, inspect.Parameter] = {}
    for made_by in _constructors(attack_class):
        for name, one in inspect.signature(made_by).parameters.items():
            if one.kind is one.KEYWORD_ONLY:
                keywords.setdefault(name, one)
    return keywords


def _types(attack_class: type[Attack]) -> dict[str, Any]:
    types: dict[str, Any] = {}
    for made_by in _constructors(attack_class):
        try:
            types = {**get_type_hints(made_by.__init__ if inspect.isclass(made_by) else made_by), **types}
        except (NameError, TypeError):  # a user's attack may declare none
            continue
    return types


def _constructors(attack_class: type[Attack]) -> Iterator[Callable[..., Any]]:
    """The attack's class, and the `__init__` of its parents, as long as each passes on `**others`."""
    parents = attack_class.__mro__[1:-1]
    for made_by in (
        attack_class,
        *(vars(parent)["__init__"] for parent in parents if "__init__" in vars(parent)),
    ):
        try:
            parameters = inspect.signature(made_by).parameters.values()
        except ValueError:  # a class of another language
            return
        yield made_by
        if not any(one.kind is one.VAR_KEYWORD for one in parameters):
            return


def _checked(attack: str, name: str, value: Value, types: Mapping[str, Any]) -> Any:
    if value in ((), ""):
        raise UsageError(f"{attack}: {name} is empty; give it a value, or leave it out")
    item_types = set(leaves(types[name])) if name in types else set()
    if str not in item_types:
        value = parse_share(value) if is_share(name) else value
        value = written_number(value, int if item_types == {int} else float)
    if name not in types:
        return value
    if types[name] == tuple[str, ...]:
        value = _strings(value)
    try:
        if isinstance(value, tuple):
            _refuse_other_types(value, item_types)
        found = TypeAdapter(types[name]).validate_python(value, strict=not isinstance(value, tuple))
        _refuse_beyond(attack, name, found)
    except ValidationError as error:
        problem = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise UsageError(f"{attack}: {name} is {short_repr(value)}: {problem}") from None
    except ValueError as error:
        raise UsageError(f"{attack}: {name} is {short_repr(value)}: {error}") from None
    return found


def _refuse_other_types(value: Value, types: set[Any]) -> None:
    """Raises ValueError for a boolean or a string among numbers, which pydantic converts within lists."""
    if isinstance(value, tuple):
        for item in value:
            _refuse_other_types(item, types)
    elif types <= {int, float} and isinstance(value, (bool, str)):
        raise ValueError(f"{short_repr(value)} is not a number")


def _refuse_beyond(attack: str, name: str, value: Any) -> None:
    """Raises ValueError for a number beyond the limit of its unit; a user's attack checks its own."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    most = MAX_BY_UNIT.get(name.rpartition("_")[2], MAX_WITHOUT_UNIT)
    if is_number and ":" not in attack and not abs(value) <= most:
        raise ValueError(f"it may be {most:g} at most")


def _strings(value: Value) -> tuple[Value, ...]:
    """A list of strings, also from a single one; ids such as 7, which YAML reads as numbers, are strings."""
    items = value if isinstance(value, tuple) else (value,)
    return tuple(str(item) if type(item) is int else item for item in items)
