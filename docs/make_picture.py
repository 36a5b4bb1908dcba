"""Makes docs/images/attack.gif: the viewer of a report, its slider going from clean to attacked.

The committed picture is of these commands:

    advpipe simulate district --set simulation.duration_s=1
    advpipe attack datasets/district --type detach --ratio 0.01 --frames ::5
    advpipe evaluate datasets/district --baseline-tries 1
    python docs/make_picture.py datasets/district/reports/small/report.html

It needs Chromium, as the tests of the viewer do.
"""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path

from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from chromium import Browser, running_browser

WIDTH, HEIGHT = 980, 640
STEPS, STEP_MS, REST_MS = 12, 90, 1400
COLOURS = 128
ONE = "document.querySelector('.adv-viewer')"


def main(report: Path, target: Path) -> None:
    """One way from clean to attacked and back, with a rest at both ends."""
    with running_browser() as browser:
        browser.open(report.resolve().as_uri(), WIDTH, HEIGHT)
        browser.evaluate(f"{ONE}.scrollIntoView()")
        browser.wait(f"{ONE}.dataset.ready === '0'")
        there = [picture(browser, step / STEPS) for step in range(STEPS + 1)]
    frames = [*there, *there[-2:0:-1]]
    lasting_ms = [REST_MS if number % STEPS == 0 else STEP_MS for number in range(len(frames))]
    palette = there[-1].quantize(COLOURS)
    first, *others = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    target.parent.mkdir(parents=True, exist_ok=True)
    first.save(target, save_all=True, append_images=others, duration=lasting_ms, loop=0, optimize=True)
    print(f"{target}: {target.stat().st_size / 1000:.0f} kB, {len(frames)} frames")


def picture(browser: Browser, progress: float) -> Image.Image:
    """The viewer with its slider at this place."""
    browser.evaluate(
        f"""(() => {{ const slider = {ONE}.querySelector('.adv-progress');
        slider.value = {progress}; slider.dispatchEvent(new Event('input')); }})()"""
    )
    time.sleep(0.3)
    edges = "({left, top, right, bottom}) => [left, top, right, bottom].map(Math.round)"
    box = browser.evaluate(f"({edges})({ONE}.getBoundingClientRect())")
    return Image.open(io.BytesIO(browser.screenshot())).convert("RGB").crop(tuple(box))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(__file__).parent / "images" / "attack.gif")
