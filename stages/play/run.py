"""`advpipe play`: a bag to ROS 2 nodes and Foxglove, at the recorded rate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.published_names import published_names
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError, as_usage_error
from advpipe.pipeline.core.signals import deferred
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.core.verbosity import detail, notice
from advpipe.pipeline.live import FOXGLOVE, ROS2
from advpipe.pipeline.live.publisher import Publisher, UnpublishableTypeError
from advpipe.pipeline.live.registry import open_publisher
from advpipe.pipeline.live.renaming import RenamingPublisher
from advpipe.stages.play.keyboard import Keyboard
from advpipe.stages.play.options import PlayOptions
from advpipe.stages.play.player import Player
from advpipe.stages.play.summary import PlayedTopic, PlaySummary
from advpipe.stages.play.timeline import Timeline


def play(
    bag: Path, options: PlayOptions, *, ready: Callable[[str], None] = lambda where: None
) -> PlaySummary:
    """Play a bag, with its debug topics, until it ends or a signal or key ends it; with `loop`, only these.

    ready: is called before the first message, with a text that says where the bag can be seen.
    Raises UsageError for what is no bag, for topics that it lacks, a port that is taken and an interface that
    is not there, and AdvpipeError for a damaged bag.
    """
    reader = BagReader(resolve_bag(bag), debug=True)
    with as_usage_error():
        timeline = Timeline(reader, options)
    with ExitStack() as opened:
        places: list[str] = []
        publishers: list[Publisher] = []
        names = published_names(reader)
        for place, publisher in _publishers(options):
            publishers.append(RenamingPublisher(opened.enter_context(closing(publisher)), names))
            places.append(place)
        _advertise(timeline, publishers)
        keyboard = opened.enter_context(Keyboard())
        stopped = opened.enter_context(deferred())
        ready(" and ".join(places))
        player = Player(publishers, keyboard, stopped.is_set)
        loops = _play_loops(player, timeline, options)
    kinds = {one.topic.name: one.topic.type for one in timeline.published}
    losses = [publisher.missed() for publisher in publishers]
    missed = player.dropped + sum((Counter(one.messages) for one in losses), Counter[str]())
    return PlaySummary(
        bag=reader.path,
        topics=tuple(
            PlayedTopic(name, kind, player.sent[name], missed[name]) for name, kind in sorted(kinds.items())
        ),
        loops=loops,
        recorded_s=player.recorded_ns * 1e-9,
        late_median_ms=player.lateness.percentile_s(50) * 1e3,
        late_p99_ms=player.lateness.percentile_s(99) * 1e3,
        late_max_ms=player.lateness.max_s * 1e3,
        missed_uncounted=any(one.uncounted for one in losses),
    )


def _play_loops(player: Player, timeline: Timeline, options: PlayOptions) -> int:
    """How often it began."""
    player.delay(options.delay_s)
    loops = 0
    while not player.has_ended and (options.loop or not loops):
        for raw in timeline.latched_before():
            player.publish(raw)
        player.play(timeline.messages(), timeline.begin_ns, options.rate)
        loops += 1
    return loops


def _publishers(options: PlayOptions) -> Iterator[tuple[str, Publisher]]:
    """Where each publishes, and itself."""
    for name, is_wanted in ((ROS2, options.ros2), (FOXGLOVE, options.foxglove)):
        if is_wanted:
            yield open_publisher(name, domain=options.domain, interface=options.interface, port=options.port)


def _advertise(timeline: Timeline, publishers: Sequence[Publisher]) -> None:
    """Announce all topics; one whose type somebody cannot publish is left out everywhere, with a notice."""
    without_qos = [one.topic.name for one in timeline.published if not one.topic.qos]
    if without_qos:
        notice(
            f"the bag states no QoS for {counted(len(without_qos), 'topic')}; ROS 2's default is offered "
            "(reliable, the last 10; /tf_static latched)"
        )
    for one in tuple(timeline.published):
        try:
            for publisher in publishers:
                publisher.advertise(one)
        except UnpublishableTypeError as error:
            notice(f"{error}; it is left out")
            timeline.leave_out(one.topic.name)
    if not timeline.published:
        raise UsageError("no topic of the bag can be published")
    detail(f"announced {counted(len(timeline.published), 'topic')}")
