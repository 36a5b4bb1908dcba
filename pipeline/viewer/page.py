"""The viewer as HTML: a part of a report that needs no other file, and the page of `advpipe view`."""

from __future__ import annotations

import html
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from advpipe.pipeline.viewer.encoding import encode_scene
from advpipe.pipeline.viewer.scene import ViewerScene

HERE = Path(__file__).parent
THREE_JS = HERE / "three" / "three.min.js"
SCRIPTS = (
    *("decode", "palette", "points", "boxes", "ground", "stage", "labels", "story", "source", "viewer"),
    *("controls", "start"),
)
"""Of `page/scripts/`, in the order in which they lie in the page."""


def viewer_html(scenes: Sequence[ViewerScene]) -> str:
    """A part of a page that shows these frames in 3D: style, scripts and data, no network; "" without frames.

    The first scene is the one that is shown first. Only one such part may stand in a page.
    """
    if not scenes:
        return ""
    data = "\n".join(
        f'<script type="application/json" class="adv-scene" data-title="{html.escape(scene.label)}">'
        f"{encode_scene(scene)}</script>"
        for scene in scenes
    )
    fragment = _read("fragment.html").replace("</section>", f"{data}\n</section>")
    three = THREE_JS.read_text(encoding="utf-8")
    return (
        f"<style>\n{style()}</style>\n{fragment}"
        f"<script>\n{three}</script>\n<script>\n{viewer_script()}</script>\n"
    )


def viewer_page() -> str:
    """The page of the server, which fetches its style, its scripts and its data."""
    fragment = _read("fragment.html").replace(
        'class="adv-viewer" data-source="page"', 'class="adv-viewer adv-full" data-source="server"'
    )
    return _read("page.html").replace("{{fragment}}", fragment)


def style() -> str:
    """The style sheet of the viewer."""
    return _read("viewer.css")


@cache
def viewer_script() -> str:
    """The viewer's own scripts as one, whose names nobody else sees; `THREE` has to be there."""
    parts = "\n".join(_read(f"scripts/{name}.js") for name in SCRIPTS)
    return f'(() => {{\n"use strict";\n{parts}}})();\n'


def _read(name: str) -> str:
    return (HERE / "page" / name).read_text(encoding="utf-8")
