"""The entry points of advpipe that targets call: each does what the command of that name does."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from pathlib import Path

from advpipe.pipeline.audit.run import audit
from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.bag.localisation import read_measurements
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recover import recover
from advpipe.pipeline.core.text import escape_unprintable
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.replay.recorded_filter import read_filter, vehicles_with_filter
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.evaluate.v2x.veremi import export_veremi
from advpipe.stages.verify.run import verify
from tests.fuzz.case import Call, Fault, Unhandled

CLOUD = "sensor_msgs/msg/PointCloud2"


def shown(print_it: Callable[[], object]) -> str:
    """What would stand on a terminal: the command line spells out what a terminal obeys."""
    with redirect_stdout(io.StringIO()) as text:
        print_it()
    return escape_unprintable(text.getvalue())


def read(bag: Path, out: Path) -> None:
    """Every message with its type's hash, every cloud."""
    reader = BagReader(bag)
    _ = reader.provenance
    for raw in reader.raw_messages():
        reader.type_hash(raw)
        if raw.topic.type == CLOUD:
            reader.cloud(raw)
        reader.decode(raw)


def inspect(bag: Path, out: Path) -> str:
    description = describe(bag)
    description.to_json()
    return shown(description.print)


def check(bag: Path, out: Path) -> str:
    result = verify(bag)
    result.to_json()
    return "\n".join(map(str, (*result.findings, *result.unchecked)))


def audited(dataset: Path, out: Path) -> str:
    result = audit([dataset], most_clouds=2)
    result.to_json()
    return "\n".join(map(str, result.results))


def frames(bag: Path, out: Path) -> None:
    for _ in read_frames(bag):
        pass


def save(bag: Path, out: Path) -> str:
    return str(recover(bag, out / "saved"))


def export(bag: Path, out: Path) -> None:
    export_veremi(bag, out / "veremi")


def replay(bag: Path, out: Path) -> None:
    """The drive's V2X sent again, and the filters of its vehicles fed again."""
    reader = BagReader(bag)
    drive = V2xDrive(reader)
    channel = drive.channel()
    for step in drive.steps():
        drive.send(channel, step, step.sent)
    recorded = read_filter(reader)
    for vehicle in vehicles_with_filter(reader):
        topics = VehicleTopics(vehicle)
        estimator = recorded.estimator(reader, topics)
        for measured in read_measurements(reader, topics):
            estimator.step(measured)


def attacked(**options: object) -> Call:
    """The bag that an attack makes."""

    def call(bag: Path, out: Path) -> None:
        attack(bag, out / "attacked", AttackRequest((attack_spec(options),)), workers=1)

    return call


def plot(bag: Path, out: Path) -> None:
    from advpipe.pipeline.bag.v2x_picture import draw_bag

    draw_bag(bag, out / "picture.png")


def view(bag: Path, out: Path) -> str:
    """The first, a middle and the last frame as the browser gets them."""
    from advpipe.pipeline.viewer.encoding import encode_scene
    from advpipe.stages.view.run import open_scenes

    scenes = open_scenes(bag)
    last = len(scenes) - 1
    return "\n".join(encode_scene(scenes.scene(index, None)) for index in sorted({0, last // 2, last}))


def play(bag: Path, out: Path) -> int:
    """What would be announced and published, as far as no network is needed."""
    from itertools import islice

    from advpipe.pipeline.bag.reader import BagReader
    from advpipe.pipeline.live.offered_qos import offered_qos
    from advpipe.pipeline.live.publisher import UnpublishableTypeError
    from advpipe.stages.play.options import PlayOptions
    from advpipe.stages.play.timeline import Timeline

    timeline = Timeline(BagReader(bag, debug=True), PlayOptions(ros2=True, start_s=0.1))
    for published in timeline.published:
        offered_qos(published.topic)
        with suppress(ImportError, UnpublishableTypeError):
            from advpipe.pipeline.live.dds_types import DdsType

            DdsType(published)
    return len([*timeline.latched_before(), *islice(timeline.messages(), 10_000)])


def evaluated(clean: Path, bag: Path, out: Path) -> None:
    """A report of one adversarial bag, without a detector that takes its time."""
    from advpipe.stages.evaluate.run import Options, evaluate, print_report

    options = Options(detectors=("tests.fuzz.blind:BlindDetector",), bootstrap_draws=10)
    report = evaluate(clean, [bag], out / "report", options, workers=1)
    shown(lambda: print_report(report))


def shared(dataset: Path, out: Path) -> None:
    from advpipe.stages.share.run import share

    share(dataset, out / "shared")
    card = (out / "shared" / "README.md").read_text(encoding="utf-8")
    if "<script" in card:
        raise Unhandled(Fault("terminal", "<script> of others in the card", "README.md", card))


BAG_CALLS: dict[str, Call] = {
    "read": read,
    "inspect": inspect,
    "verify": check,
    "frames": frames,
    "recover": save,
    "export": export,
    "replay": replay,
    "cam": attacked(type="cam-position-offset", attackers={"share": 0.3}),
    "sybil": attacked(type="cam-sybil-grid", attackers={"share": 0.3}),
    "gnss": attacked(type="gnss-bias", victim="ego"),
    "view": view,
    "play": play,
    "detach": attacked(type="detach", recipe="random", parameters={"ratio": 0.05}, frames="0:2"),
}
"""Of a bag, by the word on the command line where there is one."""
