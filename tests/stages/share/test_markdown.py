"""Text of others in Markdown, as a renderer shows it: the text itself, and no element of its own."""

from __future__ import annotations

import json
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import yaml
from markdown_it import MarkdownIt

from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.share.markdown import Markdown, authors_text, block, code, escaped, literal
from advpipe.stages.share.run import ShareOptions, share

NASTY = [
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "<!-- comment -->",
    "<!--",
    "</td></table><h1>",
    "&lt;b&gt; &amp; &#60;",
    "[a](javascript:alert(1))",
    "![a](https://example.org/track.png)",
    "[a]: https://example.org",
    "[a][b] [a]",
    "<https://example.org>",
    "https://example.org www.example.org",
    "a | b || c \\| d \\",
    "**bold** _under_ __both__ *one* ~~gone~~ `code` ``two``",
    "```\nfence\n```",
    "~~~",
    "# head",
    "a\n===",
    "a\n---\nb",
    "- item",
    "+ item",
    "1. item",
    "12) item",
    "> quote",
    "    four blanks",
    "---\nlicense: mit\n---",
    "line\n\nparagraph\n\n| a |\n|---|\n| b |",
    "\\<b\\>",
    "{{ 7 * 7 }} {% raw %}",
    "$\\foo$ $$x$$",
    "\x1b[31m\x00",
    "a<br>b",
    "<details><summary>",
    "box_truck snake_case 12.5 -3 +4 0::40",
]
PAGE = """# {escaped}

{escaped}

- {escaped}

![{escaped}](figures/x.png)

| a | b |
|---|---|
| {escaped} | {code} |
| [{code}](x) | end |

{block}

Last.
"""


class Elements(HTMLParser):
    """The elements of a page, with their attributes, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: Counter[str] = Counter()
        self.text = ""
        self.comments: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = sorted(f"{name}={value}" for name, value in attrs if name != "alt")
        self.found[" ".join([tag, *attributes])] += 1
        self.text += next((str(value) for name, value in attrs if name == "alt"), "")

    def handle_comment(self, data: str) -> None:
        self.comments.append(data)

    def handle_data(self, data: str) -> None:
        self.text += data


def rendered(text: str) -> Elements:
    return Elements(MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"]).render(text))


def page(text: str) -> str:
    return PAGE.format(escaped=escaped(text), code=code(text), block=block(text))


PLAIN = rendered(page("plain"))


@pytest.mark.parametrize("text", NASTY, ids=lambda text: ascii(text)[:20])
def test_untrusted_text_creates_no_markdown_elements(text: str) -> None:
    shown = rendered(page(text))
    assert shown.found == PLAIN.found
    assert not shown.comments


@pytest.mark.parametrize("text", NASTY, ids=lambda text: ascii(text)[:20])
def test_untrusted_text_is_shown_literally(text: str) -> None:
    expected = "".join(sign if sign.isprintable() or sign.isspace() else "\ufffd" for sign in text)
    assert " ".join(rendered(f"x {escaped(text)} x").text.split()) == f"x {' '.join(expected.split())} x"


def test_markdown_is_not_escaped_again() -> None:
    assert escaped(Markdown("`a` <b>")) == "`a` <b>"
    assert escaped("19.9 s, 0.0, -3 m") == "19.9 s, 0.0, -3 m"
    assert escaped("box_truck") == "box_truck"
    assert code("/ego/lidar/points") == "`/ego/lidar/points`"
    assert eval(literal('a"\nb`')) == 'a"\nb`'
    assert eval(literal("größe")) == "größe"


def test_the_authors_text_is_kept_or_fenced() -> None:
    assert authors_text("Recorded on a *rainy* day.") == "Recorded on a *rainy* day."
    for text in ("<script>x</script>", "a <b>c</b>", "```\nx\n```\n<!-- x -->"):
        assert not set(rendered(authors_text(text)).found) - {"pre", "code"}


HOSTILE = "<script>x</script> | `` [a](javascript:b) ![c](d) <!-- **e** \n---\n# f"


def shared_card(folder: Path, content: str) -> str:
    """The card of a drive and an attack in which every text that others choose is this one."""
    name = content.replace("/", "").replace("\n", "")
    ego = VehicleTopics("ego")
    scenario = {
        "description": content,
        "map": {
            "sumo_net": content,
            "origin": {"latitude_deg": 1.0, "longitude_deg": 2.0, "altitude_m": 3.0},
        },
        "sensors": {"lidars": {content: {"preset": content, "vehicle": content, "points_per_second": 5}}},
    }
    about = {
        "kind": "clean",
        "scenario": yaml.safe_dump(scenario),
        "scenario_name": content,
        "seed": "7",
        "map_sha256": content,
        "versions": json.dumps({content: content, "advpipe": content}),
    }
    clean = folder / "set" / "clean"
    for bag, record in ((clean, about), (folder / "set" / "attack", None)):
        attack = {
            "type": content,
            "parameters": {content: content},
            "victim": content,
            "lidar": content,
            "detector": content,
        }
        attack_record = {
            "kind": "attack",
            "attack": content,
            "recipe": content,
            "frames": content,
            "budget": content,
        }
        attack_record |= {
            "attacks": json.dumps(
                [attack, attack | {"attackers": {content: content}, "schedule": {content: content}}]
            )
        }
        attack_record |= {"parameters": json.dumps({content: content})}
        attack_record |= {} if record else {"parent_sha256": parent_sha256(clean)}
        with BagWriter(bag, provenance=record or attack_record) as writer:
            cloud = cloud_to_cdr(np.zeros(3, POINT_DTYPE), 5, content)
            writer.write_cdr(Topic(f"/{name}/points", ego.lidar_points.type), cloud, 5)
            writer.write(
                Topic(f"/{name}", ego.gnss_fix.type), build.nav_sat_fix(5, 1, 2, 3, frame_id=content), 5
            )
    share(folder / "set", folder / "out", ShareOptions(citation=f"```\n{content}"))
    return (folder / "out" / "README.md").read_text(encoding="utf-8")


def test_a_card_of_hostile_texts_is_harmless(tmp_path: Path) -> None:
    found = {}
    for number, content in enumerate(("plain", HOSTILE)):
        (tmp_path / str(number)).mkdir()
        card = shared_card(tmp_path / str(number), content)
        front, _, body = card.removeprefix("---\n").partition("\n---\n")
        assert yaml.safe_load(front)["pretty_name"] == "out"
        shown = rendered(body)
        assert shown.comments == [" made by advpipe share "]
        assert content.split()[0] in shown.text
        found[content] = Counter(
            element.split(" href=")[0].split(" src=")[0] for element in shown.found.elements()
        )
    assert found["plain"] == found[HOSTILE]
