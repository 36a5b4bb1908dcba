"""Hostile values, and trees of plain values that contain some of them."""

from __future__ import annotations

import json
import math
from copy import deepcopy
from typing import Any

from hypothesis import strategies as st

NUMBERS: tuple[float, ...] = (
    *(0, -1, 1, 2, 255, 65_536, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64),
    *(-(2**63), 10**30, 10**400, 0.5, -0.0, 1e-300, 5e-324, 1e30, 1e308, -1e308),
    *(math.nan, math.inf, -math.inf),
)  # fmt: skip
TEXTS = (
    *("", " ", "\0", "a\0b", "\x1b[31mred\x1b[0m", "\x1b]0;title\x07", "\x9b2J", "\r\n", "\u202e", "\ud800"),
    *("<script>alert(1)</script>", "](javascript:x) | `", "$\\foo$", "a$_{$b", "[red]x[/blue]", "%s%n{0}{}"),
    *("../../x", "/dev/full", "a/b", ".", "~", "nan", "1e999", "0x", "null", "2001-02-30", "é" * 50),
    *("x" * 5000, "x" * 100_000),
)


def scalars() -> st.SearchStrategy[Any]:
    """Numbers at their ends, texts that mean something somewhere, and what is neither."""
    return st.one_of(
        st.sampled_from(NUMBERS),
        st.sampled_from(TEXTS),
        st.sampled_from([None, True, False, [], {}, [[]], {"": None}]),
        st.integers(-1000, 1000),
        st.floats(),
        st.text(max_size=6),
    )


class Raw:
    """Text that is inserted into a document without quoting."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return f"Raw({self.text[:40]!r}, {len(self.text)} characters)"


def _deep(levels: int, left: str = "[", right: str = "]") -> Raw:
    return Raw(left * levels + "0" + right * levels)


def _laughs(name: str = "a", width: int = 9, levels: int = 9) -> Raw:
    """A page that stands for width**levels values."""
    lines = [f"&{name}0 [{','.join(['lol'] * width)}]"]
    lines += [f"&{name}{n} [{','.join([f'*{name}{n - 1}'] * width)}]" for n in range(1, levels)]
    return Raw(f"[{','.join(lines)}]")


JSON_RAWS = (
    *(_deep(levels) for levels in (60, 900, 5_000, 100_000)),
    *(_deep(levels, '{"a":', "}") for levels in (60, 900, 100_000)),
    *map(Raw, ("9" * 5000, "-1e999", "NaN", "-Infinity", '{"a":1,"a":2}', '"\\ud800"', "[", "}", "", "tru")),
    Raw("[" + "0," * 100_000 + "0]"),
    Raw('"\\u001b[31m"'),
)
YAML_RAWS = (
    *(_deep(levels) for levels in (60, 900, 5_000)),
    *(_laughs(levels=levels) for levels in (3, 5, 9)),
    *map(Raw, ("&a [*a]", "!!bool x", "!!timestamp x", "!!int ''")),
    *(_deep(levels, "{a: ", "}") for levels in (60, 900)),
    *map(Raw, ("&b {c: *b}", "*nobody", "!!float x")),
    *map(Raw, ("!!binary x", "!!set {a}", "!!omap [a]", "!!pairs [a]", "!x y")),
    *map(Raw, ("!!python/object:os.system {}", "!!null x")),
    *map(Raw, ("{<<: {a: b}}", "{<<: 1}", "{<<: [1]}", "{[1]: 2}", "{? {a: b} : c}", "2001-02-30")),
    *map(Raw, ("0b2", "=")),
    *map(Raw, (":".join(["1"] * 20_000), "9" * 5000, ".inf", ".nan", '"\\ud800"', '"\\0"', "'", "{", "@")),
    *map(Raw, ("2001-01-01 00:00:00 +99:99", "0000-00-00", "!!timestamp 9999-12-31 23:59:59 -23:59")),
)  # fmt: skip


def paths(tree: Any) -> list[tuple[Any, ...]]:
    """Every place in a tree, its root first."""
    found: list[tuple[Any, ...]] = [()]
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        found += [(key, *rest) for rest in paths(value)]
    return found


EDITS = ("replace", "replace", "replace", "replace", "drop", "wrap", "rename", "add", "repeat", "move")


@st.composite
def edited_trees(draw: st.DrawFn, tree: Any, raws: tuple[Raw, ...], most: int = 3) -> tuple[Any, str]:
    """The tree with some changes, at most so many, and what they are."""
    tree, notes = deepcopy(tree), []
    for _ in range(draw(st.integers(1, most))):
        places = paths(tree)
        upper = [path for path in places if len(path) <= 2]  # most places are numbers deep inside
        path = draw(st.one_of(st.sampled_from(upper), st.sampled_from(places)))
        edit = draw(st.sampled_from(EDITS))
        value = draw(st.one_of(scalars(), st.sampled_from(raws), st.sampled_from(raws[:10])))
        notes.append(f"{edit} {'/'.join(map(str, path))} {value!r:.60}")
        if not path:
            tree = {**tree, "unknown": value} if isinstance(tree, dict) and edit != "replace" else value
            continue
        _edit(tree, path, edit, value, draw)
    return tree, "; ".join(notes)


def _edit(tree: Any, path: tuple[Any, ...], edit: str, value: Any, draw: st.DrawFn) -> None:
    holder, key = tree, path[-1]
    for step in path[:-1]:
        holder = holder[step]
    old = holder[key]
    if edit == "drop":
        del holder[key]
    elif edit == "wrap":
        holder[key] = draw(st.sampled_from([[old], {"a": old}, [old, old]]))
    elif edit == "rename" and isinstance(holder, dict):
        holder[draw(st.sampled_from([*TEXTS, "unknown"]))] = holder.pop(key)
    elif edit == "add" and isinstance(old, dict):
        old[draw(st.sampled_from([*TEXTS, "unknown", "1"]))] = value
    elif edit == "add" and isinstance(old, list):
        old.append(value)
    elif edit == "repeat" and isinstance(old, list):
        holder[key] = old * draw(st.sampled_from([2, 1000]))
    elif edit == "move":
        other = draw(st.sampled_from(paths(tree)))
        for step in other:
            tree = tree[step]
        holder[key] = deepcopy(tree)
    else:
        holder[key] = value


def document(tree: Any) -> str:
    """A tree as JSON, which YAML reads too; `Raw` texts stand in it as they are."""
    raws: list[str] = []

    def plain(value: Any) -> Any:
        if isinstance(value, Raw):
            raws.append(value.text)
            return f"RAW{len(raws) - 1:06}RAW"
        if isinstance(value, dict):
            return {key: plain(item) for key, item in value.items()}
        return [plain(item) for item in value] if isinstance(value, list) else value

    text = json.dumps(plain(tree), default=str)
    for number, raw in enumerate(raws):
        text = text.replace(f'"RAW{number:06}RAW"', raw)
    return text
