"""Lichtblick in headless Chromium as the viewer: not the server's own side of the protocol.

ADVPIPE_LICHTBLICK names the folder of a built Lichtblick for the web (`yarn run web:build:prod` makes
`web/.webpack`), 1.22 or later.
"""

import os
import subprocess
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlencode

import pytest
from chromium import needs_browser, running_browser

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.viewer_layouts.files import FOXGLOVE, layout_texts

FOLDER = os.environ.get("ADVPIPE_LICHTBLICK", "")
BAG = shipped_sample() / "clean"
PLAY = [sys.executable, "-m", "advpipe", "play", str(BAG)]
PLACEHOLDER = "/*LICHTBLICK_SUITE_DEFAULT_LAYOUT_PLACEHOLDER*/"
TOPICS_TAB = "document.querySelector('[data-testid=topics-left]')"

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(not FOLDER, reason="ADVPIPE_LICHTBLICK names no built Lichtblick"),
    *needs_browser[1:],
]


OBJECTS = "/ego/ground_truth/objects"


class Pages(SimpleHTTPRequestHandler):
    """The build, whose place for a layout to begin with (its container's way) has the bag's own."""

    def do_GET(self) -> None:
        if not self.path.startswith("/?"):
            super().do_GET()
            return
        page = (Path(FOLDER) / "index.html").read_text(encoding="utf-8")
        assert PLACEHOLDER in page
        filled = page.replace(PLACEHOLDER, layout_texts(BAG)[FOXGLOVE]).encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.send_header("Content-Length", str(len(filled)))
        self.end_headers()
        self.wfile.write(filled)

    def log_message(self, *arguments: object) -> None: ...


def test_it_lists_the_topics_and_decodes_the_objects(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    bag = BagReader(BAG, debug=True)
    topics = set(bag.topics)
    counts = {f"detections [] {len(message.detections)} items" for _, message in bag.messages(OBJECTS)}
    pages = ThreadingHTTPServer(("127.0.0.1", 0), partial(Pages, directory=FOLDER))
    threading.Thread(target=pages.serve_forever, daemon=True).start()
    player = subprocess.Popen(
        [*PLAY, "--foxglove", "--port", "0", "--loop"], stderr=subprocess.PIPE, text=True
    )
    try:
        assert player.stderr is not None
        while "ws://" not in (line := player.stderr.readline()):
            assert line, "the player has ended"
        address = line.partition("played to ")[2].partition(";")[0]
        query = urlencode({"ds": "foxglove-websocket", "ds.url": address})
        with running_browser() as browser:
            browser.resize(1400, 900)
            url = f"http://127.0.0.1:{pages.server_address[1]}/?{query}"
            browser.call("Page.navigate", url=url)
            # The sidebar opens with the settings of panels; the list of topics is its second tab.
            browser.wait(f"!!{TOPICS_TAB}")
            browser.evaluate(f"{TOPICS_TAB}.click()")
            browser.wait("document.body.innerText.includes('/ego/lidar/points')")
            browser.wait(r"/detections\s/.test(document.body.innerText)")
            (tmp_path / "lichtblick.png").write_bytes(browser.screenshot())
            text = browser.evaluate("document.body.innerText")
            listed = {" ".join(line.split()) for line in text.splitlines()}
            assert topics <= listed, f"not listed: {sorted(topics - listed)}"
            assert counts & listed, f"none of {counts} in the panel of raw messages"
    finally:
        player.terminate()
        player.wait(30)
        pages.shutdown()
