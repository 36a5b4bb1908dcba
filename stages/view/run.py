"""`advpipe view`: a bag in the browser, until the command is interrupted."""

from __future__ import annotations

import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path

from advpipe.pipeline.bag.locate import CLEAN_NAME, adversarial_bags, bag_named, resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.signals import deferred
from advpipe.stages.view.bag_scenes import BagScenes
from advpipe.stages.view.recording import find_viewpoint
from advpipe.stages.view.report_detections import reports_of
from advpipe.stages.view.server import LOCALHOST, ViewServer

_LOOK_S = 0.2


def open_scenes(path: Path, lidar_topic: str | None = None, report: Path | None = None) -> BagScenes:
    """The frames of a bag; of a data set, its clean bag with all its attacks; of one attack of a data set,
    the clean bag with this attack.

    report: whose detections are shown; by default, those of the data set's reports.
    Raises UsageError for what is no bag, holds nothing to look at, and for a report without detections.
    """
    path = bag_named(path)
    bag = resolve_bag(path)
    reports = reports_of(path if bag != path else path.parent, report)
    if bag != path:
        return BagScenes(bag, {one.name: one for one in adversarial_bags(path)}, lidar_topic, reports)
    clean = path.parent / CLEAN_NAME
    if path == clean:
        return BagScenes(bag, {}, lidar_topic, reports)
    if path.is_dir() and clean.is_dir() and BagReader(path).provenance.is_attack:
        find_viewpoint(BagReader(path), lidar_topic)
        return BagScenes(resolve_bag(clean), {path.name: path}, lidar_topic, reports)
    return BagScenes(bag, {}, lidar_topic, reports if report else ())


def view(
    path: Path,
    *,
    lidar_topic: str | None = None,
    report: Path | None = None,
    port: int = 0,
    open_browser: bool = True,
    ready: Callable[[str], None] = lambda url: None,
) -> None:
    """Serves the bag on this machine until a signal ends it. ready: is called with the address.

    Raises UsageError as `open_scenes`, and for a port that is taken.
    """
    scenes = open_scenes(path, lidar_topic, report)
    try:
        server = ViewServer(scenes, port)
    except OSError as error:
        raise UsageError(
            f"port {port} of {LOCALHOST} cannot be used ({error.strerror}); choose another, or none"
        ) from None
    with server, deferred() as stopped:
        threading.Thread(target=server.serve_forever, args=(_LOOK_S,), daemon=True).start()
        ready(server.url)
        if open_browser:
            webbrowser.open(server.url)
        waiting = threading.Event()
        while not stopped.is_set():
            waiting.wait(_LOOK_S)
        server.shutdown()
