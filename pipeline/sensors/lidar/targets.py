"""What the beams of one turn meet: surfaces of the world, two at once at edges, and the own body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.lidar.edges import mix_edges
from advpipe.pipeline.sensors.lidar.imperfections import Imperfections
from advpipe.pipeline.sensors.lidar.intensity import return_signal, wet_share
from advpipe.pipeline.sensors.lidar.own_body import OwnBody
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.lidar.sweep import LidarSweep
from advpipe.pipeline.sensors.world import SURFACES, Hits, SurfaceDetail

Float32 = npt.NDArray[np.float32]

MIN_RANGE_M = 0.9

LEAST_RELIEF_COS = np.float32(0.25)
"""At a more grazing incidence, the beam's spot covers bumps and hollows at once."""

_WET = np.array([name in ("road", "marking", "pavement", "ground") for name in SURFACES])


class Targets(NamedTuple):
    """What N of the R rays meet within the sensor's range.

    all_m: (R,) float32, range of the target of every ray, infinite where there is none. rays: (N,) int64,
    ascending. range_m: (N,) float32 to the middle of the surface; relief_m: (N,), by which it is nearer.
    cos_incidence, signal: (N,), the signal in clear air. wet: (N,), its share that rain on the ground leaves.
    objects: (N,) as in `Hits`.
    """

    all_m: Float32
    rays: npt.NDArray[np.int64]
    range_m: Float32
    relief_m: Float32
    cos_incidence: Float32
    signal: Float32
    wet: Float32
    objects: npt.NDArray[np.int32]


def targets_of(
    hits: Hits,
    sensor: LidarSensor,
    sweep: LidarSweep,
    own: OwnBody | None,
    wetness: float,
    rng: np.random.Generator,
) -> Targets:
    """The targets of one turn; the generator draws where the edges of objects lie in the beams.

    wetness: in [0, 1], how much of the ground is covered with water; all of it from 1 mm of rain an hour.
    """
    real = sensor.imperfections
    all_m = hits.range_m.copy()
    if own is not None:
        all_m[own.shaded] = own.range_m[own.shaded]
    if real.beam_divergence_deg and sweep.columns > 1:
        spacing_rad = 2 * np.pi / sweep.columns
        mix_edges(all_m, sweep.channels, spacing_rad, float(np.deg2rad(real.beam_divergence_deg)), rng)
    rays = np.flatnonzero((all_m >= MIN_RANGE_M) & (all_m <= sensor.range))
    cos = hits.cos_incidence[rays]
    detail = _switched(hits, real)
    signal = return_signal(hits, rays, sensor.atmosphere_attenuation_rate, detail)
    relief_m: Float32 = np.zeros(len(rays), np.float32)
    if detail is not None and real.relief:
        relief_m = detail.relief_m[rays]
        relief_m /= np.maximum(cos, LEAST_RELIEF_COS)
    wet = np.ones(len(rays), np.float32)
    if wetness and (surfaces := hits.surfaces) is not None:
        ground = np.flatnonzero(_WET[surfaces[rays]] & ~hits.retroreflective[rays])
        wet[ground] -= np.float32(wetness) * (1 - wet_share(cos[ground]))
    objects = hits.objects[rays]
    if own is not None:
        mine = np.flatnonzero(own.shaded[rays])
        signal[mine], objects[mine] = own.signal[rays[mine]], -1
        relief_m[mine], cos[mine], wet[mine] = 0, 1, 1
    return Targets(all_m, rays, all_m[rays], relief_m, cos, signal, wet, objects)


def _switched(hits: Hits, real: Imperfections) -> SurfaceDetail | None:
    """The parts of the surfaces' detail that are not turned off."""
    detail = hits.detail() if real.texture or real.gloss or real.relief else None
    if detail is None:
        return None
    texture = detail.texture if real.texture else np.ones_like(detail.texture)
    return SurfaceDetail(texture, detail.relief_m, detail.gloss if real.gloss else np.zeros_like(texture))
