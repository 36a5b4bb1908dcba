"""MkDocs hooks: what the code knows is read from the code, so that no page has to repeat it.

A page asks for the table of a family's attacks with `<!-- catalogue: v2x -->`, for the whole docstrings of
their classes with `<!-- details: v2x -->`, for the meaning of a report's values with
`<!-- figures: detection -->`, and for all keys of a list in `report.json` with `<!-- keys: v2x -->`.
Pictures of the committed reports are served as `reports/...`.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markdown import Extension, Markdown
from markdown.preprocessors import Preprocessor

if TYPE_CHECKING:
    from advpipe.stages.attack.base import Attack

ROOT = Path(__file__).resolve().parents[1]
REPORTS = ROOT / "datasets" / "reports"

VEREMI = {1: "constant", 2: "constant offset", 4: "random", 8: "random offset", 16: "eventual stop"}
EXTENSION = dict(
    enumerate(
        [
            "constant position",
            "constant position offset",
            "random position",
            "random position offset",
            "constant speed",
            "constant speed offset",
            "random speed",
            "random speed offset",
            "eventual stop",
            "disruptive",
            "data replay",
            "stale messages",
            "DoS",
            "DoS random",
            "DoS disruptive",
            "grid Sybil",
            "data replay Sybil",
            "DoS random Sybil",
            "DoS disruptive Sybil",
        ],
        start=1,
    )
)
NEXTGEN = dict(
    enumerate(
        [
            "constantPositionOffset",
            "randomPositionOffset",
            "positionMirroring",
            "constantSpeedOffset",
            "randomSpeedOffset",
            "zeroSpeedReport",
            "suddenConstantSpeed",
            "reversedHeading",
            "feignedBraking",
            "accelerationMultiplication",
            "timeDelayAttack",
            "dosAttack",
            "trafficCongestionSybil",
            "suddenStop",
            "dataReplay",
        ],
        start=1,
    )
)
"""What VeReMi (SecureComm 2018), VeReMi Extension (F2MD) and VeReMi NextGen call their attacks, by number."""


class _Doctests(Preprocessor):
    """Shows the examples of docstrings, which begin with >>>, as code rather than as quotations."""

    def run(self, lines: list[str]) -> list[str]:
        text = "\n".join(lines)
        return re.sub(r"(?:^|(?<=\n))(>>> .*(?:\n.+)*)", r"```pycon\n\1\n```", text).split("\n")


class _DoctestExtension(Extension):
    def extendMarkdown(self, md: Markdown) -> None:
        md.preprocessors.register(_Doctests(md), "doctests", 100)  # before fences are looked for


def on_config(config: Any) -> Any:
    config["markdown_extensions"].append(_DoctestExtension())
    return config


def on_files(files: Any, config: Any) -> Any:
    """Adds the pictures of the committed reports to the site."""
    from mkdocs.structure.files import File

    for path in sorted(REPORTS.rglob("*.png")):
        place = f"reports/{path.relative_to(REPORTS).as_posix()}"
        files.append(File.generated(config, place, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replaces each `<!-- KIND: NAME -->` by what it asks for."""
    kinds: dict[str, Callable[[str], str]] = {
        "catalogue": catalogue,
        "details": details,
        "figures": figures,
        "keys": keys,
        "presets": presets,
    }
    return re.sub(rf"<!-- ({'|'.join(kinds)}): (\w+) -->", lambda it: kinds[it[1]](it[2]), markdown)


def catalogue(family: str) -> str:
    """The table of all registered attacks of a family: lidar, v2x, gnss, radar or camera."""
    heads, row = {
        "lidar": (("attack", "budget", "what it does"), _lidar_row),
        "v2x": (
            (
                "attack",
                "what it does",
                "needs a ticket",
                "VeReMi",
                "VeReMi Extension",
                "VeReMi NextGen",
            ),
            _v2x_row,
        ),
        "gnss": (("attack", "in the paper", "what it does"), _gnss_row),
        **dict.fromkeys(("radar", "camera"), (("attack", "what it does"), _plain_row)),
    }[family]
    return _table(heads, [row(name, kind) for name, kind in _attacks(family).items()])


def details(family: str) -> str:
    """The whole docstring of every attack of a family; each of its parameters is an item of a list."""
    texts = [
        f"### {name}\n\nParameters: {_parameters(kind) or 'none'}.\n\n{_text(kind)}"
        for name, kind in _attacks(family).items()
    ]
    return "\n\n".join(texts)


def presets(family: str) -> str:
    """The attacks of a family with presets: what each does, and how it differs from our default."""
    rows = [
        (_link(name), f"`{preset}`", _done_by(found), _escaped(found.remark) or "nothing")
        for name, kind in _attacks(family).items()
        for preset, found in vars(kind).get("presets", {}).items()
    ]
    return _table(("attack", "preset", "what it does", "what differs from our default, and why"), rows)


def _done_by(preset: Any) -> str:
    """What a preset does: the parameters of the attack itself, or what another class says."""
    if preset.attack_class is not None:
        return _summary(preset.attack_class)
    return _code([f"{name}={value}" for name, value in preset.parameters.items()]) or "what our default does"


def figures(section: str) -> str:
    """The meanings of a section's values, in the report's own words, with their keys in `report.json`."""
    from advpipe.stages.evaluate.cooperative import collective
    from advpipe.stages.evaluate.cooperative import section as cooperative
    from advpipe.stages.evaluate.coordinated import section as coordinated
    from advpipe.stages.evaluate.kitti import section as kitti
    from advpipe.stages.evaluate.localisation import section as localisation
    from advpipe.stages.evaluate.radar import section as radar
    from advpipe.stages.evaluate.report import attack_detection
    from advpipe.stages.evaluate.report.report import DEFINITIONS
    from advpipe.stages.evaluate.v2x import denm_section, privacy, signed_messages
    from advpipe.stages.evaluate.v2x import section as v2x

    formulas = {
        "detection": DEFINITIONS,
        "attack_detection": attack_detection.FORMULAS,
        "kitti": kitti.FORMULAS,
        "localisation": localisation.FORMULAS,
        "v2x": v2x.FORMULAS,
        "security": (signed_messages.FORMULA,),
        "privacy": (privacy.FORMULA,),
        "denm": (denm_section.FORMULA,),
        "cooperative": cooperative.FORMULAS,
        "collective_perception": collective.FORMULAS,
        "coordinated": coordinated.FORMULAS,
        "radar": radar.FORMULAS,
    }[section]
    rows = [
        (each.name.replace("_", " "), _code(each.keys), _escaped(each.meaning.replace("{of_what}", "drive")))
        for each in formulas
    ]
    return _table(("value", "keys in `report.json`", "meaning"), rows)


def keys(section: str) -> str:
    """All keys of what `report.json` lists under `section`, as its JSON Schema describes them."""
    from advpipe.pipeline.results.schema import report_schema

    items = report_schema()["properties"][section]["items"]
    found = {**items["properties"], **items.get("patternProperties", {})}
    rows = [
        (f"`{key}`", _escaped(each["description"]))
        for key, each in found.items()
        if not each.get("deprecated")
    ]
    return _table(("key", "meaning"), rows)


def _attacks(family: str) -> Mapping[str, type[Attack]]:
    from advpipe.stages.attack.camera.registry import CAMERA_ATTACKS
    from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS
    from advpipe.stages.attack.lidar.registry import LIDAR_ATTACKS
    from advpipe.stages.attack.radar.registry import RADAR_ATTACKS
    from advpipe.stages.attack.v2x.registry import V2X_ATTACKS

    known: dict[str, Mapping[str, type[Attack]]] = {
        "lidar": LIDAR_ATTACKS,
        "v2x": V2X_ATTACKS,
        "gnss": GNSS_ATTACKS,
        "radar": RADAR_ATTACKS,
        "camera": CAMERA_ATTACKS,
    }
    return known[family]


def _lidar_row(name: str, kind: Any) -> tuple[str, ...]:
    budget = kind.traits.budget
    return _link(name), f"`{budget.parameter}` ({budget.title})", _summary(kind)


def _v2x_row(name: str, kind: Any) -> tuple[str, ...]:
    published = kind.traits.published
    numbers = (published.veremi_2018, published.veremi_extension, published.nextgen)
    called = (_called(*each) for each in zip(numbers, (VEREMI, EXTENSION, NEXTGEN), strict=True))
    return (_link(name), _summary(kind), "yes" if kind.traits.needs_ticket else "no", *called)


def _plain_row(name: str, kind: Any) -> tuple[str, ...]:
    return _link(name), _summary(kind)


def _gnss_row(name: str, kind: Any) -> tuple[str, ...]:
    also = ", ".join(f"`{word}`" for word in kind.traits.also_known_as)
    return _link(name), also, _summary(kind)


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ("---",) * len(heads), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _code(names: Sequence[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _link(name: str) -> str:
    return f"[`{name}`](#{name})"


def _called(number: int | None, names: Mapping[int, str]) -> str:
    return f"{number} {names[number]}" if number in names else ""


def _summary(kind: type) -> str:
    """The first paragraph of the class's docstring, as it may stand in a table."""
    return _escaped(inspect.cleandoc(kind.__doc__ or "").partition("\n\n")[0])


def _text(kind: type) -> str:
    """The docstring as Markdown: what it says of a parameter begins with its name and a colon."""
    paragraphs = inspect.cleandoc(kind.__doc__ or "").split("\n\n")
    return "\n\n".join(
        re.sub(r"(?:^|(?<=\. ))((?:[a-z]\w*, )*[a-z]\w*): ", r"\n- `\1`: ", _escaped(paragraph)).strip()
        for paragraph in paragraphs
    )


def _escaped(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("*", "\\*").replace("+-", "±")


def _parameters(kind: type) -> str:
    """The keyword-only parameters of the constructor with their defaults."""
    found = inspect.signature(kind).parameters.values()
    return ", ".join(
        f"`{one.name}`" if one.default is one.empty else f"`{one.name}={one.default}`"
        for one in found
        if one.kind is one.KEYWORD_ONLY
    )
