"""Text of others in Markdown, as a renderer shows it: the text itself, and no element of its own."""

from __future__ import annotations

from collections import Counter
from html.parser import HTMLParser

import pytest
from markdown_it import MarkdownIt

from advpipe.stages.share.markdown import Markdown, block, code, escaped, literal, own_words

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
        words = sorted(f"{name}={value}" for name, value in attrs if name != "alt")
        self.found[" ".join([tag, *words])] += 1
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
def test_no_element_of_its_own(text: str) -> None:
    shown = rendered(page(text))
    assert shown.found == PLAIN.found
    assert not shown.comments


@pytest.mark.parametrize("text", NASTY, ids=lambda text: ascii(text)[:20])
def test_it_is_shown_as_it_is_written(text: str) -> None:
    expected = "".join(sign if sign.isprintable() or sign.isspace() else "\ufffd" for sign in text)
    assert " ".join(rendered(f"x {escaped(text)} x").text.split()) == f"x {' '.join(expected.split())} x"


def test_ours_stays() -> None:
    assert escaped(Markdown("`a` <b>")) == "`a` <b>"
    assert escaped("19.9 s, 0.0, -3 m") == "19.9 s, 0.0, -3 m"
    assert escaped("box_truck") == "box_truck"
    assert code("/ego/lidar/points") == "`/ego/lidar/points`"
    assert eval(literal('a"\nb`')) == 'a"\nb`'
    assert eval(literal("größe")) == "größe"


def test_own_words() -> None:
    assert own_words("Recorded on a *rainy* day.") == "Recorded on a *rainy* day."
    for text in ("<script>x</script>", "a <b>c</b>", "```\nx\n```\n<!-- x -->"):
        assert not set(rendered(own_words(text)).found) - {"pre", "code"}
