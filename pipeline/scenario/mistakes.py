"""What is wrong with a scenario, in one line: every mistake with its key, its line and what may be meant."""

from __future__ import annotations

import typing
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.short_repr import short_repr, shorten
from advpipe.pipeline.scenario.document import ScenarioText
from advpipe.pipeline.scenario.mistake import Mistake, Place, SeveralMistakesError
from advpipe.pipeline.scenario.models import Scenario

LONGEST_MESSAGE = 1000
MOST_MISTAKES = 20
"""That are spelt out; whoever has more reads the rest when these are corrected."""


def mistakes_line(
    found: Sequence[Mistake], path: Path, document: ScenarioText, overridden: Sequence[Place]
) -> str:
    """All mistakes in one line, numbered if there are several.

    Each with its key; with the line in the file, or the option for a key that an override gives.
    """
    lines, set_option = document.lines(), option_name("settings")
    texts = []
    for given, message in found[:MOST_MISTAKES]:
        place, key = _written(given, document.tree)
        text = f"{_attack_at(given, document.tree, message)}{message}"
        if place and any(all(map(str.__eq__, keys, place)) for keys in overridden):
            texts.append(f"{set_option} {key}: {text}")
            continue
        line = lines.get(place) or lines.get(tuple(part for part in place if not part.isdigit()))
        texts.append(f"{key}{f' (line {line})' if line else ''}: {text}" if key else text)
    if len(found) == 1:
        (only,) = texts
        return _on_one_line(only if only.startswith(f"{set_option} ") else f"{path}: {only}")
    numbered = "; ".join(f"({number}) {text}" for number, text in enumerate(texts, 1))
    more = f"; and {len(found) - MOST_MISTAKES} more" if len(found) > MOST_MISTAKES else ""
    return _on_one_line(f"{path}: {len(found)} mistakes: {numbered}{more}")


def schema_mistakes(error: ValidationError, model: type[BaseModel] = Scenario) -> Iterator[Mistake]:
    """Place and message of each; the first of those at one place, where a value may have several forms.

    A list with items that are refused is not called too short, too, which it is without them. model: that
    refused the document.
    """
    seen: set[Place] = set()
    for each in error.errors():
        several = each.get("ctx", {}).get("error")
        if isinstance(several, SeveralMistakesError):
            yield from several.found
            continue
        place = tuple(str(part) for part in each["loc"] if part != "[key]")
        has_refused_items = any(len(other) > len(place) and other[: len(place)] == place for other in seen)
        if has_refused_items and each["type"] == "too_short":
            continue
        if place not in seen or not place:
            seen.add(place)
            yield place, _message(dict(each), place, model)


def _written(place: Place, tree: Any) -> tuple[Place, str]:
    """The place in the tree, and as people write it: `attacks.a[1].victim`.

    Where one item stands for a list of it, the file has no number.
    """
    found, text, node = list[str](), "", tree
    for part in place:
        if isinstance(node, list) and part.isdigit():
            text += f"[{part}]"
            node = node[int(part)] if int(part) < len(node) else None
        elif part == "0" and isinstance(node, dict) and part not in node:
            continue
        else:
            text += f"{'.' if text else ''}{shorten(part)}"
            node = node.get(part) if isinstance(node, dict) else None
        found.append(part)
    return tuple(found), text


def _attack_at(place: Place, tree: Any, message: str) -> str:
    """The name of the attack that a mistake is in, as `detach: `; "" where the message has it."""
    if place[:1] != ("attacks",) or len(place) < 3 or place[-1] == "type":
        return ""
    bags = tree.get("attacks")
    bag = bags.get(place[1]) if isinstance(bags, dict) else None
    items = bag if isinstance(bag, list) else [bag]
    number = int(place[2]) if place[2].isdigit() else 0
    item = items[number] if number < len(items) else None
    attack = item.get("type") if isinstance(item, dict) else None
    if not isinstance(attack, str) or short_repr(attack) in message or message.startswith(attack):
        return ""
    return f"{shorten(attack)}: "


COUNTED = {"too_long": ("at most", "max_length"), "too_short": ("at least", "min_length")}
"""How many items a list may have, by pydantic's type of the mistake: the bound, and its name there."""


def _message(each: dict[str, Any], place: Place, model: type[BaseModel]) -> str:
    if each["type"] == "extra_forbidden":
        own = "; an attack's own go into `parameters`" if place[0] == "attacks" and len(place) == 4 else ""
        return f"unknown key; {known_names(place[-1], _keys_at(place[:-1], model))}{own}"
    if each["type"] == "missing":
        return "is missing"
    if each["type"] in COUNTED and isinstance(each["input"], (list, tuple, dict)):
        bound, limit = COUNTED[each["type"]]
        return f"has {len(each['input'])} items; {bound} {each['ctx'][limit]} are allowed"
    message = shorten(each["msg"].removeprefix("Value error, "), LONGEST_MESSAGE)
    return message if isinstance(each["input"], dict) else f"{message}, not {short_repr(each['input'])}"


def _keys_at(place: Place, model: type[BaseModel]) -> list[str]:
    for part in place:
        annotation: Any = model.model_fields[part].annotation if part in model.model_fields else model
        model = next(iter(_models_in(annotation)), model)
    return list(model.model_fields)


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in typing.get_args(annotation) for model in _models_in(part)]


def _on_one_line(text: str) -> str:
    return " ".join(text.split())
