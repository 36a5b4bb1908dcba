"""The tree of frames of a recording: what does not move, and what did around an instant."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64, invert, se3

LONGEST_GAP_NS = 500_000_000
"""Up to here a transform is interpolated between two others, or the nearest one stands for it."""

_MOST_FRAMES, _MOST_KEPT = 10_000, 20_000


@dataclass
class _Track:
    """parent_SE3_child over time, ascending."""

    parent: str
    stamps_ns: list[int] = field(default_factory=list)
    transforms: list[Float64] = field(default_factory=list)

    def add(self, stamp_ns: int, parent_SE3_child: Float64) -> None:
        place = bisect_left(self.stamps_ns, stamp_ns)
        if place < len(self.stamps_ns) and self.stamps_ns[place] == stamp_ns:
            self.transforms[place] = parent_SE3_child
            return
        self.stamps_ns.insert(place, stamp_ns)
        self.transforms.insert(place, parent_SE3_child)
        if len(self.stamps_ns) > _MOST_KEPT:
            self.forget(1)

    def forget(self, count: int) -> None:
        del self.stamps_ns[:count], self.transforms[:count]

    def at(self, stamp_ns: int) -> Float64 | None:
        place = bisect_left(self.stamps_ns, stamp_ns)
        if place < len(self.stamps_ns) and self.stamps_ns[place] == stamp_ns:
            return self.transforms[place]
        if 0 < place < len(self.stamps_ns):
            before_ns, after_ns = self.stamps_ns[place - 1], self.stamps_ns[place]
            if after_ns - before_ns <= LONGEST_GAP_NS:
                share = (stamp_ns - before_ns) / (after_ns - before_ns)
                return _between(self.transforms[place - 1], self.transforms[place], share)
        near = [k for k in (place - 1, place) if 0 <= k < len(self.stamps_ns)]
        best = min(near, key=lambda k: abs(self.stamps_ns[k] - stamp_ns), default=None)
        if best is None or abs(self.stamps_ns[best] - stamp_ns) > LONGEST_GAP_NS:
            return None
        return self.transforms[best]


class TransformTree:
    """Transforms by their child frame; a child has one parent, the first that is named.

    prefers_odometry: whether odometry stands where there are both it and transforms.
    """

    def __init__(self, prefers_odometry: bool = False) -> None:
        self._prefers_odometry = prefers_odometry
        self._static: dict[str, tuple[str, Float64]] = {}
        self._moving: dict[str, _Track] = {}
        self._odometry: dict[str, _Track] = {}

    @property
    def frames(self) -> set[str]:
        """All that are named, the roots included."""
        parents = {parent for parent, _ in self._static.values()}
        tracks = {**self._odometry, **self._moving}
        return {*self._static, *tracks, *parents, *(track.parent for track in tracks.values())}

    @property
    def odometry_frames(self) -> set[str]:
        """Children of odometry."""
        return set(self._odometry)

    @property
    def moving_frames(self) -> set[str]:
        """Children of transforms that may change."""
        return {*self._moving, *self._odometry}

    def add_static(self, parent: str, child: str, parent_SE3_child: Float64) -> None:
        """What is known once for all."""
        self._refuse_many(child)
        self._static[_bare(child)] = (_bare(parent), parent_SE3_child)

    def add(self, parent: str, child: str, stamp_ns: int, parent_SE3_child: Float64) -> None:
        """What is known at an instant."""
        self._add(self._moving, parent, child, stamp_ns, parent_SE3_child)

    def add_odometry(self, parent: str, child: str, stamp_ns: int, parent_SE3_child: Float64) -> None:
        """A pose of a message of odometry."""
        self._add(self._odometry, parent, child, stamp_ns, parent_SE3_child)

    def _add(
        self, tracks: dict[str, _Track], parent: str, child: str, stamp_ns: int, parent_SE3_child: Float64
    ) -> None:
        self._refuse_many(child)
        track = tracks.setdefault(_bare(child), _Track(_bare(parent)))
        if track.parent == _bare(parent) and parent and child:
            track.add(stamp_ns, parent_SE3_child)

    def _refuse_many(self, child: str) -> None:
        if len(self._static) + len(self._moving) + len(self._odometry) > _MOST_FRAMES:
            raise AdvpipeError(f"the recording has more than {_MOST_FRAMES:,} frames of transforms")

    def forget_before(self, stamp_ns: int) -> None:
        """Forget all but the last transforms before an instant."""
        for track in (*self._moving.values(), *self._odometry.values()):
            track.forget(max(0, bisect_left(track.stamps_ns, stamp_ns) - 1))

    def root(self, frame: str) -> str:
        """The frame above all others over a frame."""
        return self.chain(frame)[-1]

    def lookup(self, destination: str, source: str, stamp_ns: int) -> Float64 | None:
        """`destination_SE3_source` at an instant; None where nothing connects them then."""
        up, from_destination = np.eye(4), {}
        chain = self.chain(destination)
        for frame in chain:
            from_destination[frame] = up
            step = self._above(frame, stamp_ns)
            if step is None:
                break
            up = step @ up
        up = np.eye(4)
        for frame in self.chain(source):
            if frame in from_destination:
                return invert(from_destination[frame]) @ up
            step = self._above(frame, stamp_ns)
            if step is None:
                return None
            up = step @ up
        return None

    def chain(self, frame: str) -> list[str]:
        """A frame and all above it; a loop ends where it closes."""
        chain = [_bare(frame)]
        while (parent := self._parent(chain[-1])) is not None and parent not in chain:
            chain.append(parent)
        return chain

    def _parent(self, frame: str) -> str | None:
        if frame in self._static:
            return self._static[frame][0]
        track = self._track(frame)
        return track.parent if track else None

    def _track(self, frame: str) -> _Track | None:
        both = self._moving.get(frame), self._odometry.get(frame)
        first, second = reversed(both) if self._prefers_odometry else both
        return first or second

    def _above(self, frame: str, stamp_ns: int) -> Float64 | None:
        """parent_SE3_frame."""
        if frame in self._static:
            return self._static[frame][1]
        track = self._track(frame)
        return track.at(stamp_ns) if track else None


def _bare(frame: str) -> str:
    """ROS 1 wrote frames with a slash before tf2."""
    return frame.removeprefix("/")


def _between(first: Float64, second: Float64, share: float) -> Float64:
    """The transform a share of the way, its rotation at a constant rate."""
    turn = Rotation.from_matrix(first[:3, :3].T @ second[:3, :3]).as_rotvec()
    rotation = first[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    return se3(rotation, (1 - share) * first[:3, 3] + share * second[:3, 3])
