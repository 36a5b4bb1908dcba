"""The viewer in a real browser: what is drawn follows the slider, and a click tells an object's story."""

import base64
import io
import json

import numpy as np
import pytest
from chromium import needs_browser
from matplotlib.image import imread
from scenes import moving_scene, removing_scene

from advpipe.pipeline.viewer.page import viewer_html

pytestmark = needs_browser

ONE = "document.querySelector('.adv-viewer')"
LOST_RGB, TRUTH_RGB, ADDED_RGB = (0xD9, 0x77, 0x00), (0x1D, 0x5F, 0xD1), (0xC2, 0x18, 0x9B)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    part = viewer_html([removing_scene(), moving_scene()])
    path.write_text(f"<!doctype html><html lang=en><meta charset=utf-8><title>a</title><body>{part}</body>")
    return path


@pytest.fixture
def opened(browser, page):
    """The page in a window of this size, once its first frame is drawn."""

    def open_page(width=1400, height=900, **options):
        browser.problems.clear()
        browser.requests.clear()
        browser.open(page.as_uri(), width, height, **options)
        browser.wait(f"{ONE}.dataset.ready === '0'")
        drawn(browser)
        return browser

    yield open_page
    assert browser.problems == []
    assert all(url == page.as_uri() or url.startswith("data:") for url in browser.requests)


def drawn(browser):
    """Waits until what was asked for is on the canvas."""
    browser.evaluate("new Promise(then => requestAnimationFrame(() => requestAnimationFrame(then)))")


def canvas(browser):
    """The pixels (H, W, 3) of the canvas, 0 to 255."""
    found = browser.evaluate(f"{ONE}.querySelector('canvas').toDataURL('image/png')")
    return np.rint(imread(io.BytesIO(base64.b64decode(found.partition(",")[2])))[..., :3] * 255).astype(int)


def slide(browser, progress):
    script = f"""(() => {{ const slider = {ONE}.querySelector('.adv-progress');
        slider.value = {progress}; slider.dispatchEvent(new Event('input')); }})()"""
    browser.evaluate(script)
    drawn(browser)


def pixels(picture, rgb):
    return int((np.abs(picture - rgb).max(axis=-1) <= 6).sum())


def text(browser, name):
    return browser.evaluate(f"{ONE}.querySelector('.adv-{name}').innerText")


def choose(browser, name, value):
    script = f"""(() => {{ const list = {ONE}.querySelector('.adv-{name}');
        list.value = {json.dumps(value)}; list.dispatchEvent(new Event('change')); }})()"""
    browser.evaluate(script)
    drawn(browser)


def place_of(browser, selector):
    """The middle of an element's lower edge in the window."""
    return browser.evaluate(
        f"""(() => {{ const box = {ONE}.querySelector({json.dumps(selector)}).getBoundingClientRect();
        return [box.left + box.width / 2, box.bottom]; }})()"""
    )


def test_the_picture_follows_the_slider(opened):
    browser = opened()
    choose(browser, "objects", "")
    slide(browser, 0)
    before = canvas(browser)
    assert pixels(before, ADDED_RGB) == 0
    slide(browser, 1)
    after = canvas(browser)
    assert pixels(after, LOST_RGB) > 3 * pixels(before, LOST_RGB)
    assert pixels(after, TRUTH_RGB) < 0.85 * pixels(before, TRUTH_RGB)  # the lost car's box
    assert pixels(after, ADDED_RGB) > 20
    slide(browser, 0)
    assert np.array_equal(canvas(browser), before)


def test_moved_points_travel(opened):
    browser = opened()
    choose(browser, "frame", "1")
    browser.wait(f"{ONE}.dataset.ready === '1'")
    choose(browser, "stretch", "20")
    slide(browser, 0)
    before = canvas(browser)
    slide(browser, 1)
    assert (canvas(browser) != before).any(axis=-1).sum() > 300
    assert text(browser, "stretched") == "displacements × 20"


def test_a_click_on_a_box_tells_its_story(opened):
    browser = opened()
    browser.evaluate(f"{ONE}.querySelector('.adv-canvas').focus()")
    browser.press("Escape")
    assert "Click on a box" in text(browser, "story")
    x, y = place_of(browser, ".adv-label.adv-lost")
    browser.click(x, y + 6)  # on the roof of the box below
    drawn(browser)
    story = text(browser, "story")
    assert story.startswith("car ego.7")
    for words in ("lost", "Found on the clean cloud only.", "0.83", "0.21", "143", "97", "12.4 m"):
        assert words in story
    browser.click(*[*place_of(browser, ".adv-canvas")][:1], place_of(browser, ".adv-canvas")[1] - 4)
    drawn(browser)
    assert "Click on a box" in text(browser, "story")  # the ground is no object


def test_a_lost_object_is_told_of_at_once(opened):
    assert text(opened(), "story").startswith("car ego.7")


def test_what_is_lost_is_found_at_the_clean_end(opened):
    browser = opened()
    assert browser.evaluate(f"{ONE}.querySelectorAll('.adv-label.adv-lost').length") > 0
    assert text(browser, "chip") == "lost"
    slide(browser, 0)
    assert browser.evaluate(f"{ONE}.querySelectorAll('.adv-label.adv-lost').length") == 0
    assert text(browser, "chip") == "found"
    slide(browser, 1)
    assert text(browser, "chip") == "lost"


def test_everything_can_be_done_with_the_keyboard(opened):
    browser = opened()
    browser.evaluate(f"{ONE}.querySelector('.adv-canvas').focus()")
    pictures = [canvas(browser)]
    for key in ("t", "e", "r", "ArrowLeft", "+", "f", "a"):
        browser.press(key)
        drawn(browser)
        pictures.append(canvas(browser))
        assert not np.array_equal(pictures[-1], pictures[-2]), key
    assert np.array_equal(pictures[3], pictures[0])  # reset: as it was
    titles = set()
    for _ in range(4):
        browser.press("o")
        drawn(browser)
        titles.add(text(browser, "story").splitlines()[0])
    assert {"car ego.8", "predicted car, 0.91"} <= {
        title.removesuffix(" found").strip() for title in titles
    } | titles
    browser.press("n")
    browser.wait(f"{ONE}.dataset.ready === '1'")
    assert "perturb, frame 4" in text(browser, "heading")
    names = "[...document.querySelectorAll('.adv-viewer :is(button, select, input, canvas)')]"
    unnamed = (
        f"{names}.filter(e => !(e.labels?.length || e.ariaLabel || e.title || e.innerText.trim())).length"
    )
    assert browser.evaluate(unnamed) == 0


def test_predictions_can_be_hidden(opened):
    browser = opened()
    before = canvas(browser)
    browser.evaluate(
        f"[...{ONE}.querySelectorAll('button.adv-mark')].find(e => e.innerText === 'predictions').click()"
    )
    drawn(browser)
    assert not np.array_equal(canvas(browser), before)


@pytest.mark.parametrize("width", [390, 1400, 2560])
@pytest.mark.parametrize("is_dark", [False, True], ids=["light", "dark"])
def test_every_width_and_theme(opened, width, is_dark):
    browser = opened(width, 900, is_dark=is_dark)
    assert browser.evaluate("document.documentElement.scrollWidth <= innerWidth")
    overflowing = f"""[...{ONE}.querySelectorAll('.adv-bar *, .adv-side *, .adv-legend *')].filter(e =>
        e.getBoundingClientRect().right > {ONE}.getBoundingClientRect().right + 1).length"""
    assert browser.evaluate(overflowing) == 0
    corner = canvas(browser)[-1, 0]
    assert (corner < 60).all() if is_dark else (corner > 220).all()
    height = browser.evaluate(f"{ONE}.querySelector('canvas').clientHeight")
    assert 260 <= height <= 900


def test_a_browser_without_webgl_is_told(browser, page, tmp_path):
    hidden = "<script>HTMLCanvasElement.prototype.getContext = () => null</script>"
    other = tmp_path / "page.html"
    other.write_text(page.read_text().replace("<body>", f"<body>{hidden}"))
    browser.open(other.as_uri())
    browser.wait(f"{ONE}.querySelector('.adv-story').innerText.includes('cannot be drawn')")
