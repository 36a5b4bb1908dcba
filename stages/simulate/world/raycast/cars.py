"""Cars, vans and buses: a hull with wheel arches, a glazed cabin, and the interior behind its windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, ellipsoid, merge, tube
from advpipe.stages.simulate.world.raycast.shapes import Profile, band, panels, wheel

FRAME_M = 0.05
PILLAR_M = 0.09


@dataclass(frozen=True)
class CarShape:
    """A side view in shares of length (-0.5 the rear) and height, and how it is glazed and furnished.

    rear, front: the hull's outline behind the cabin, from the rear bumper up, and before it, down to the
    front bumper. cabin: the outline from the rear end of the belt line over the roof to the windscreen's
    foot. roof: the roof's width as a share of the belt's. pillars, rows, axles: places along the length.
    glazed_from, tinted_to: where windows begin, and where tinted ones end. bed: whether it has a load bed.
    """

    rear: Profile
    cabin: Profile
    front: Profile
    roof: float
    pillars: Sequence[float]
    rows: Sequence[float]
    axles: Sequence[float] = (-0.29, 0.31)
    wheel_radius_m: float = 0.32
    glazed_from: float = -0.5
    tinted_to: float = -0.5
    rear_glass: bool = True
    bed: bool = False

    def __call__(self, length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
        """The mesh at this size; `pose` in [0, 1]: a passenger is on board above 0.6."""
        size = np.array([length_m, height_m])
        parts = [
            *self._hull(size, width_m, paint),
            *self._cabin(size, width_m, paint),
            *_inside(self, length_m, width_m, height_m, pose),
            *_ends(length_m, width_m, height_m, self.rear[1][1], self.front[-2][1]),
            *(
                wheel(x * length_m, side * (width_m / 2 - 0.015), self.wheel_radius_m, 0.21)
                for x in self.axles
                for side in (-1, 1)
            ),
        ]
        return merge(parts)

    def _hull(self, size: Float64, width_m: float, paint: str) -> list[Mesh]:
        top = np.array([*self.rear, self.cabin[0], self.cabin[-1], *self.front]) * size
        floor_m = float(min(top[0, 1], top[-1, 1]))
        arches = [_arch(x * size[0], self.wheel_radius_m, floor_m) for x in sorted(self.axles, reverse=True)]
        under = np.array([(top[-1, 0], floor_m), *(point for arch in arches for point in arch)])
        outline = np.concatenate([top, under, [[top[0, 0], floor_m]], top[:1]])

        def half_width(points: Float64) -> Float64:
            nose = np.clip((np.abs(points[:, 0]) / size[0] - 0.44) / 0.06, 0, 1)
            half: Float64 = width_m / 2 * (1 - 0.1 * nose**2)
            return half

        materials: list[str | None] = [*[paint] * (len(top) - 1), *["plastic"] * (len(outline) - len(top))]
        materials[len(self.rear)] = None  # the belt line: the cabin is open to the hull
        if self.bed:
            materials[len(self.rear) - 1] = None
        sides = panels(shapely.make_valid(shapely.Polygon(outline)), half_width, paint)
        return [sides, band([(x, z) for x, z in outline], half_width(outline).tolist(), materials)]

    def _cabin(self, size: Float64, width_m: float, paint: str) -> list[Mesh]:
        outline = np.array(self.cabin) * size
        low, high = float(outline[:, 1].min()), float(outline[:, 1].max())

        def half_width(points: Float64) -> Float64:
            half: Float64 = width_m / 2 * (1 - (1 - self.roof) * (points[:, 1] - low) / (high - low))
            return half

        side = shapely.make_valid(shapely.Polygon(outline))
        windows = side.buffer(-FRAME_M - 0.06 * max(high - low - 0.5, 0.0), join_style="mitre")
        for x in self.pillars:
            middle_m = x * size[0]
            windows -= shapely.box(middle_m - PILLAR_M / 2, 0, middle_m + PILLAR_M / 2, 9)
        windows &= shapely.box(self.glazed_from * size[0], 0, 99, 9)
        tinted = windows & shapely.box(-99, 0, self.tinted_to * size[0], 9)
        steep = [abs(b[1] - a[1]) > 0.12 for a, b in zip(self.cabin, self.cabin[1:], strict=False)]
        panes: list[str | None] = ["glass" if is_steep else paint for is_steep in steep]
        panes[0] = ("glass_tinted" if self.tinted_to > -0.5 else "glass") if self.rear_glass else paint
        return [
            panels(side - windows, half_width, paint),
            panels(windows - tinted, half_width, "glass"),
            panels(tinted, half_width, "glass_tinted"),
            band([(x, z) for x, z in outline], half_width(outline).tolist(), panes),
        ]


def _arch(x_m: float, radius_m: float, floor_m: float) -> list[tuple[float, float]]:
    """A wheel arch in the underside, from its front end to its rear end."""
    reach_m = 1.16 * radius_m
    end = np.arcsin(np.clip((floor_m - radius_m) / reach_m, -1, 1))
    return [
        (float(x_m + reach_m * np.cos(a)), float(radius_m + reach_m * np.sin(a)))
        for a in np.linspace(end, np.pi - end, 7)
    ]


def _inside(shape: CarShape, length_m: float, width_m: float, height_m: float, pose: float) -> list[Mesh]:
    """Floor, dashboard, seats and occupants."""
    belt_m = shape.cabin[-1][1] * height_m
    back_m, ahead_m = shape.cabin[0][0] * length_m, shape.cabin[-1][0] * length_m
    middle_m, long_m = (back_m + ahead_m) / 2, ahead_m - back_m
    parts = [
        box_mesh((long_m, 0.92 * width_m, 0.02), "interior").moved(middle_m, 0, belt_m - 0.62),
        box_mesh((0.4, 0.9 * width_m, 0.3), "interior").moved(ahead_m - 0.22, 0, belt_m - 0.3),
    ]
    if shape.bed:
        bed_m = (-0.5 * length_m + back_m) / 2
        floor = box_mesh((back_m + 0.5 * length_m - 0.06, 0.9 * width_m, 0.02), "plastic")
        parts.append(floor.moved(bed_m, 0, 0.38 * height_m))
        parts.append(box_mesh((0.04, 0.92 * width_m, 0.5), "plastic").moved(back_m, 0, belt_m - 0.5))
    for row, x in enumerate(shape.rows):
        for side in (-1, 1):
            parts += _seat(x * length_m, side * 0.24 * width_m, 0.38 * width_m, belt_m, row < 2)
    people = [(shape.rows[0], 1)] + [(shape.rows[0], -1)] * (pose > 0.6)
    return parts + [p for x, s in people for p in _sitting(x * length_m, s * 0.24 * width_m, belt_m)]


def _seat(x_m: float, y_m: float, width_m: float, belt_m: float, whole: bool) -> list[Mesh]:
    parts = [box_mesh((0.12, width_m, 0.72), "interior").moved(x_m - 0.26, y_m, belt_m - 0.5)]
    if whole:
        parts.append(box_mesh((0.5, width_m, 0.16), "interior").moved(x_m, y_m, belt_m - 0.56))
    return parts


def _sitting(x_m: float, y_m: float, belt_m: float) -> list[Mesh]:
    """The upper body of an occupant."""
    torso = tube((x_m, y_m, belt_m - 0.4), (x_m - 0.1, y_m, belt_m + 0.14), 0.17, "cloth_dark", 6)
    return [torso, ellipsoid((x_m - 0.06, y_m, belt_m + 0.27), (0.1, 0.08, 0.12), "skin", 3)]


def _ends(length_m: float, width_m: float, height_m: float, tail: float, nose: float) -> list[Mesh]:
    """Number plates, head-lamps and tail-lamps."""
    plate, lamp = box_mesh((0.02, 0.52, 0.11), "plate"), box_mesh((0.1, 0.16 * width_m, 0.13), "lamp")
    parts = [
        plate.moved(-length_m / 2 - 0.01, 0, 0.62 * tail * height_m),
        plate.moved(length_m / 2 + 0.01, 0, 0.3 * height_m if height_m < 2 else 0.45),
    ]
    for side in (-1, 1):
        parts.append(lamp.moved(-length_m / 2 + 0.03, side * 0.36 * width_m, tail * height_m - 0.2))
        parts.append(lamp.moved(length_m / 2 - 0.03, side * 0.34 * width_m, nose * height_m - 0.16))
    return parts
