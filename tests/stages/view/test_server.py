"""The server: what it answers, to whom, and nothing else; and the page in a browser."""

import contextlib
import http.client
import json
import signal
import socket
import subprocess
import sys
import threading
import urllib.request

import pytest
from chromium import needs_browser
from first_words import without_progress

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.stages.view.run import open_scenes
from advpipe.stages.view.server import ViewServer

ONE = "document.querySelector('.adv-viewer')"


@pytest.fixture(scope="module")
def server(dataset):
    with ViewServer(open_scenes(dataset)) as found:
        threading.Thread(target=found.serve_forever, args=(0.05,), daemon=True).start()
        yield found
        found.shutdown()


def ask(server, path, host=None, method="GET"):
    """Status, headers and body."""
    connection = http.client.HTTPConnection(*server.server_address[:2], timeout=60)
    with contextlib.closing(connection):
        connection.putrequest(method, path, skip_host=True)
        if host != "":
            connection.putheader("Host", host or f"127.0.0.1:{server.server_address[1]}")
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read().decode()


def test_the_page_and_its_parts(server):
    for path, kind in (
        ("/", "text/html"),
        ("/viewer.css", "text/css"),
        ("/viewer.js", "text/javascript"),
        ("/three.min.js", "text/javascript"),
        ("/bag.json", "application/json"),
        ("/scene/1/0.json", "application/json"),
    ):
        status, headers, body = ask(server, path)
        assert status == 200
        assert headers["Content-Type"].startswith(kind)
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert "Access-Control-Allow-Origin" not in headers
        assert len(body) > 100


def test_frames_are_made_when_they_are_asked_for(server):
    about = json.loads(ask(server, "/bag.json")[2])
    assert len(about["frames"]) == 20
    assert about["options"] == ["cam", "detach", "gnss", "clean bag alone"]
    cam, detach, gnss, clean = about["attacked"]
    assert detach == [[0, 3]]
    assert cam
    assert gnss == [[0, 19]]
    assert clean == []
    attacked = json.loads(ask(server, "/scene/1/3.json")[2])
    alone = json.loads(ask(server, "/scene/3/3.json")[2])
    assert attacked["is_attacked"]
    assert not alone["is_attacked"]
    assert attacked["points"]["counts"][2] > 0
    assert sum(attacked["points"]["total"]) == sum(alone["points"]["total"])


@pytest.mark.parametrize(
    "path",
    [
        *("/scene/1/20.json", "/scene/4/0.json", "/scene/-1/0.json", "/scene/0/1e1.json", "/scene/0/.json"),
        *("/../../etc/passwd", "//etc/passwd", "/%2e%2e/metadata.yaml", "/clean/metadata.yaml", "/scene"),
        *("/scenes/../page.html", "/viewer.js/x", "/scene/0/99999999999999999999.json"),
    ],
)
def test_there_is_nothing_else(server, path):
    status, _, body = ask(server, path)
    assert status == 404
    assert len(body) < 40


@pytest.mark.parametrize(
    "host", ["", "evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1.evil.example:{port}"]
)
def test_another_name_than_this_machines_is_refused(server, host):
    """A page whose name was pointed at this machine sends its own name."""
    for path in ("/", "/bag.json", "/scene/0/0.json"):
        status, _, body = ask(server, path, host.format(port=server.server_address[1]))
        assert status == 421
        assert "{" not in body


def test_localhost_is_this_machine(server):
    assert ask(server, "/bag.json", f"localhost:{server.server_address[1]}")[0] == 200


def test_only_reading(server):
    for method in ("POST", "PUT", "DELETE", "OPTIONS"):
        assert ask(server, "/bag.json", method=method)[0] == 501


def test_only_this_machine_can_connect(server):
    assert server.socket.getsockname()[0] == "127.0.0.1"


def test_several_browsers_at_once(server):
    found = []

    def look(number):
        found.append(ask(server, f"/scene/{number % 4}/{number}.json")[0])

    with contextlib.closing(socket.create_connection(server.server_address[:2])):  # one that says nothing
        threads = [threading.Thread(target=look, args=(number,)) for number in range(12)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60)
    assert found == [200] * 12


def test_a_damaged_frame_is_told_in_a_line(dataset, tmp_path):
    with BagWriter(tmp_path / "bag", provenance={}) as writer:
        for number, raw in enumerate(BagReader(dataset / "clean").raw_messages()):
            if raw.topic.name != "/ego/ground_truth/objects" or number > 300:
                writer.copy(raw)
    with ViewServer(open_scenes(tmp_path / "bag")) as server:
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        status, _, body = ask(server, "/scene/0/0.json")
        assert (status, body.count("\n")) == (422, 0)
        assert "no message of /ego/ground_truth/objects" in body
        assert ask(server, "/scene/0/19.json")[0] == 200
        server.shutdown()


def test_the_command_serves_until_it_is_interrupted(dataset):
    command = [sys.executable, "-m", "advpipe", "view", str(dataset), "--no-browser"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        process.stderr.readline()  # its first word
        line = process.stderr.readline()
        url = next(word for word in line.split() if word.startswith("http://127.0.0.1:"))
        with urllib.request.urlopen(f"{url}bag.json", timeout=60) as answer:
            assert len(json.load(answer)["frames"]) == 20
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert (process.returncode, out, errors) == (0, "ended\n", "")


def test_nothing_stays_of_a_killed_viewer(dataset):
    """It writes nothing, and its port is free at once."""
    before = {path: path.stat().st_mtime_ns for path in sorted(dataset.rglob("*"))}
    command = [sys.executable, "-m", "advpipe", "view", str(dataset), "--no-browser", "--port"]
    port = "0"
    for asked in ((), ("bag.json",), ("bag.json", "scene/1/3.json")):
        process = subprocess.Popen([*command, port], stderr=subprocess.PIPE, text=True)
        try:
            words = (word for line in process.stderr for word in line.split())
            url = next(word for word in words if word.startswith("http://"))
            for path in asked:
                with urllib.request.urlopen(f"{url}{path}", timeout=60) as answer:
                    answer.read(100)  # and no more
        finally:
            process.kill()
            process.communicate()
        port = url.rstrip("/").rpartition(":")[2]
    assert {path: path.stat().st_mtime_ns for path in sorted(dataset.rglob("*"))} == before


def test_a_port_that_is_taken(dataset, server):
    port = server.server_address[1]
    command = [sys.executable, "-m", "advpipe", "view", str(dataset), "--port", str(port), "--no-browser"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert without_progress(done.stderr).count("\n") == 1
    assert f"port {port} of 127.0.0.1 cannot be used" in done.stderr


def first_attacked(server):
    """The frame that the page opens at."""
    return server.scenes.attacked_runs(0)[0][0]


@pytest.fixture
def opened(server, browser):
    browser.problems.clear()
    browser.requests.clear()
    browser.open(server.url)
    browser.wait(f"{ONE}.dataset.ready === '{first_attacked(server)}'")
    yield browser
    assert browser.problems == []
    assert all(url.startswith((server.url, "data:")) for url in browser.requests)


def drawn(browser):
    browser.evaluate("new Promise(then => requestAnimationFrame(() => requestAnimationFrame(then)))")
    return browser.evaluate(f"{ONE}.querySelector('canvas').toDataURL()")


def go_to(browser, frame):
    browser.evaluate(
        f"""(() => {{ const line = {ONE}.querySelector('.adv-time'); line.value = {frame};
        line.dispatchEvent(new Event('input')); }})()"""
    )
    browser.wait(f"{ONE}.dataset.ready === '{frame}'")


class TestInTheBrowser:
    pytestmark = needs_browser

    def test_it_opens_at_the_attack_which_the_time_line_marks(self, opened, server):
        marks = f"[...{ONE}.querySelectorAll('.adv-attacked > *')].map(e => e.style.left)"
        shown = opened.evaluate(marks)
        assert [float(left.rstrip("%")) for left in shown] == pytest.approx(
            [100 * first / 19 for first, _ in server.scenes.attacked_runs(0)], abs=1e-3
        )
        assert opened.evaluate(f"{ONE}.querySelector('.adv-now').textContent").startswith(
            f"{first_attacked(server)}: "
        )

    def test_the_time_line_streams_frames(self, opened, server):
        before = drawn(opened)
        go_to(opened, 12)
        assert drawn(opened) != before
        assert opened.evaluate(f"{ONE}.querySelector('.adv-now').textContent") == "12: 1.20 s"
        asked = [url for url in opened.requests if "/scene/" in url]
        assert [url.rpartition("/scene/")[2] for url in asked] == [
            f"0/{first_attacked(server)}.json",
            "0/12.json",
        ]

    def test_scrubbing_asks_for_few_frames(self, opened, server):
        """Those that were passed while another was on its way are left out; the last one is shown."""
        first = first_attacked(server)
        opened.evaluate(
            f"""(() => {{ const line = {ONE}.querySelector(".adv-time");
            for (let i = {first + 1}; i < 19; i++) {{
                line.value = i; line.dispatchEvent(new Event("input")); }} }})()"""
        )
        opened.wait(f"{ONE}.dataset.ready === '18'")
        asked = [url.rpartition("/")[2] for url in opened.requests if "/scene/" in url]
        assert asked == [f"{first}.json", f"{first + 1}.json", "18.json"]

    def test_another_bag(self, opened):
        opened.evaluate(
            f"""(() => {{ const list = {ONE}.querySelector('.adv-option'); list.value = '1';
            list.dispatchEvent(new Event('change')); }})()"""
        )
        opened.wait(f"{ONE}.querySelector('.adv-heading').textContent.startsWith('detach')")
        assert "removed" in opened.evaluate(f"{ONE}.querySelector('.adv-legend').innerText")

    def test_it_plays(self, opened):
        opened.evaluate(f"{ONE}.querySelector('.adv-run').click()")
        opened.wait(f"Number({ONE}.dataset.ready) >= 3")
        opened.evaluate(f"{ONE}.querySelector('.adv-run').click()")

    def test_map_and_radio_are_in_the_legend(self, opened):
        go_to(opened, 15)
        legend = opened.evaluate(f"{ONE}.querySelector('.adv-legend').innerText")
        for name in ("truth", "CAMs", "Local Dynamic Map", "lanes", "true path", "believed path"):
            assert name in legend
