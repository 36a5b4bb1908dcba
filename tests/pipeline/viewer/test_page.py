"""What a page of the viewer is made of: a part that needs nothing else, a bundle that is what it says."""

import hashlib
import json
import re
from pathlib import Path

from scenes import moving_scene, removing_scene

from advpipe.pipeline.viewer.page import HERE, SCRIPTS, THREE_JS, style, viewer_html, viewer_page

THREE = THREE_JS.parent


def test_the_bundle_is_the_one_that_is_named():
    about = json.loads((THREE / "version.json").read_text())
    assert hashlib.sha256(THREE_JS.read_bytes()).hexdigest() == about["sha256"]
    wanted = json.loads((THREE / "package.json").read_text())["devDependencies"]
    locked = json.loads((THREE / "package-lock.json").read_text())["packages"]
    assert about["version"] == wanted["three"] == locked["node_modules/three"]["version"]
    assert locked["node_modules/three"]["integrity"].startswith("sha512-")
    assert locked["node_modules/esbuild"]["version"] == wanted["esbuild"]


def test_the_bundle_carries_its_licence():
    text = THREE_JS.read_text(encoding="utf-8")
    licence = (THREE / "LICENSE.txt").read_text(encoding="utf-8")
    assert "MIT License" in licence
    assert licence in text[:2000]


def test_a_page_needs_no_network():
    """The one address in it names the namespace of elements, and is never fetched."""
    page = viewer_html([removing_scene()])
    assert set(re.findall(r"\bhttps?://[\w./-]+", page)) == {"http://www.w3.org/1999/xhtml"}
    assert not re.search(r"""(src|href)\s*=\s*["']""", page)
    assert "@import" not in page
    assert "url(" not in style()


def test_every_script_is_in_the_page():
    names = {path.stem for path in (HERE / "page" / "scripts").glob("*.js")}
    assert names == set(SCRIPTS)
    page = viewer_html([removing_scene()])
    assert page.count("<script>") == 2
    assert page.count("</script>") == 3


def test_frames_are_listed_in_order():
    page = viewer_html([moving_scene(), removing_scene()])
    assert re.findall(r'data-title="([^"]*)"', page) == ["4", "3: 1 lost"]
    assert viewer_html([]) == ""


def test_every_class_of_the_markup_is_styled_or_used():
    """A class that neither the style nor a script knows is a misspelt one."""
    known = style() + "".join(path.read_text() for path in Path(HERE, "page", "scripts").glob("*.js"))
    for name in set(re.findall(r"adv-[\w-]+", viewer_page())):
        short = name.removeprefix("adv-")
        assert name in known or f'"{short}"' in known, name
