"""A radar at the level of detections: what it sees of a scene in one scan.

Scattering points on road users and on all else, with occlusion by ray casting (Buehren and Yang, Simulation
of automotive radar target lists using a novel approach of object representation, IV 2006), go through the
radar equation into resolution cells; cells with noise that exceed the threshold of a CFAR, and are peaks, are
detections. Not modelled: sidelobes, masking by strong targets in the CFAR's window, interference by other
radars (see the attack `radar-jam`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.localisation.motion import MotionStep
from advpipe.pipeline.messages.radar import RETURN_DTYPE, RadarReturns
from advpipe.pipeline.sensors.radar import detection
from advpipe.pipeline.sensors.radar.aim import Aim, Aiming
from advpipe.pipeline.sensors.radar.mirrors import barrier_facets, mirror_images
from advpipe.pipeline.sensors.radar.propagation import Propagation
from advpipe.pipeline.sensors.radar.resolution import (
    ELEVATION,
    RANGE,
    VELOCITY,
    are_peaks,
    fill_cells,
    folded,
    resolutions,
)
from advpipe.pipeline.sensors.radar.scatterers import Scatterers, beneath_vehicles, scatterers_of
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.pipeline.sensors.weather import Weather
from advpipe.pipeline.sensors.world import Hits


class Radar:
    """One sensor in given weather.

    period_s: time between its scans. cell_width: (4,), of a resolution cell; 0 for elevation where that is
    not measured.
    """

    def __init__(self, section: RadarSensor, period_s: float, weather: Weather | None = None) -> None:
        self.section = section
        self.propagation = Propagation(section, weather or Weather())
        self.base_SE3_radar: Float64 = se3_from_yaw(
            [section.x_m, section.y_m, section.z_m], *np.deg2rad([section.yaw_deg, section.pitch_deg])
        )
        self._aiming = Aiming(section, period_s)
        width = resolutions(section)
        self.cell_width: Float64 = np.where(np.isfinite(width), width, 0.0)
        self._alpha = detection.threshold_factor(section.false_alarm_probability, section.cfar_cells)

    def velocity_mps(self, motion: MotionStep) -> Float64:
        """Its own velocity (3,) over the ground, in its own axes."""
        lever_mps = np.cross(motion.turn_rate_radps, self.base_SE3_radar[:3, 3])
        velocity: Float64 = self.base_SE3_radar[:3, :3].T @ (motion.base_velocity_mps + lever_mps)
        return velocity

    def aim(self, boxes: Boxes, rng: np.random.Generator) -> Aim:
        """The rays of a scan, at boxes in the radar's frame and at all else."""
        return self._aiming.draw(boxes, rng)

    def scatterers(
        self, aim: Aim, hits: Hits, boxes: Boxes, turn_rate_radps: Float64, rng: np.random.Generator
    ) -> Scatterers:
        """What the rays hit, with mirror images in guard rails; boxes and results in the radar's frame."""
        direct = scatterers_of(aim, hits, boxes, turn_rate_radps, rng)
        hidden = beneath_vehicles(aim, hits, boxes, turn_rate_radps, self.section.underbody_share)
        facets = barrier_facets(aim, hits) if self.section.guard_rail_reflection else np.zeros((0, 2, 2))
        return direct + hidden + mirror_images(direct, boxes, facets, self.section.guard_rail_reflection)

    def measure(
        self,
        scatterers: Scatterers,
        velocity_mps: Float64,
        rng: np.random.Generator,
        with_false_alarms: bool = True,
    ) -> RadarReturns:
        """The detections (K,) of one scan, by range.

        velocity_mps: (3,) of the radar over the ground, in its own axes.
        """
        section = self.section
        measured, signal = self._signals(scatterers, velocity_mps)
        cells = fill_cells(section, measured, signal, signal * (scatterers.users >= 0))
        case = np.where(cells.of_users > cells.signal / 2, section.swerling, 1)
        factors = [detection.fluctuation(each, len(case), rng) for each in (0, 1, 3)]
        power = detection.received_power(cells.signal * np.choose(np.minimum(case, 2), factors), rng)
        detected = power > self._thresholds(len(power), rng)
        power, centre = power[detected], cells.centre[detected]
        peaks = are_peaks(section, centre, power)
        power, centre = power[peaks], centre[peaks]
        noise = rng.standard_normal(centre.shape) * self.cell_width / np.sqrt(2 * power)[:, None]
        measured = folded(section, centre + noise)
        if with_false_alarms:
            false_powers, places = self.false_alarms(rng)
            power, measured = np.concatenate([power, false_powers]), np.concatenate([measured, places])
        return self._listed(measured, power)

    def detected_again(
        self, signal: Float64, rng: np.random.Generator
    ) -> tuple[Float64, npt.NDArray[np.bool_]]:
        """New powers (N,) of cells with these signals, over the noise, and whether they are detected."""
        power = detection.received_power(signal, rng)
        return power, power > self._thresholds(len(power), rng)

    def folded(self, measured: Float64) -> Float64:
        """Measurements (N, 4) with ambiguities, see `resolution.folded`."""
        return folded(self.section, measured)

    def _thresholds(self, count: int, rng: np.random.Generator) -> Float64:
        return detection.thresholds(self._alpha, self.section.cfar_cells, count, rng)

    def rcs_dbsm(self, returns: RadarReturns) -> Float64:
        """The RCS (N,) that the radar states, from amplitude and place of each return in free space."""
        places = (returns[name].astype(np.float64) for name in ("range", "azimuth", "elevation"))
        return np.asarray(returns["amplitude"] - 10 * np.log10(self.propagation.snr_of_1m2(*places)))

    def _signals(self, scatterers: Scatterers, velocity_mps: Float64) -> tuple[Float64, Float64]:
        """Folded measurements (N, 4) and powers (N,) of the scatterers in range and in the field of view."""
        section, place_m = self.section, scatterers.position_m
        range_m = np.maximum(np.linalg.norm(place_m, axis=1), 1e-3)
        azimuth = np.arctan2(place_m[:, 1], place_m[:, 0])
        elevation = np.arcsin(np.clip(place_m[:, 2] / range_m, -1, 1))
        rate_mps = ((scatterers.velocity_mps - velocity_mps) * place_m).sum(axis=1) / range_m
        signal = scatterers.rcs_m2 * self.propagation.snr_of_1m2(range_m, azimuth, elevation)
        on_road = scatterers.users >= 0
        signal[on_road] *= self.propagation.ground_factor(range_m[on_road], scatterers.height_m[on_road])
        signal[range_m > section.range] = 0.0
        signal[np.abs(azimuth) > np.deg2rad(section.horizontal_fov) / 2] = 0.0
        if not section.elevation_resolution_deg:
            elevation = np.zeros_like(elevation)
        return folded(section, np.stack([range_m, azimuth, elevation, rate_mps], axis=1)), signal

    def false_alarms(self, rng: np.random.Generator) -> tuple[Float64, Float64]:
        """Powers (F,) and measurements (F, 4) of noise alone that exceeds the threshold."""
        section = self.section
        count = int(rng.binomial(section.cells, section.false_alarm_probability))
        power = detection.false_alarm_powers(self._alpha, section.cfar_cells, count, rng)
        half = np.array(
            [
                section.range / 2,
                np.deg2rad(section.horizontal_fov) / 2,
                np.deg2rad(section.vertical_fov) / 2 if section.elevation_resolution_deg else 0.0,
                section.max_velocity_mps,
            ]
        )
        places = rng.uniform(-1, 1, (count, 4)) * half
        places[:, 0] += section.range / 2
        return power, places

    def returns_of_hits(self, hits: Float64) -> RadarReturns:
        """Returns, by range, of what another simulator's radar measured without power, (N, 4): each has the
        power of a target of 1 m² in its place, so that the RCS is 0 dBsm. The first `max_returns` are kept.
        """
        measured = folded(self.section, hits)
        if not self.section.elevation_resolution_deg:
            measured[:, ELEVATION] = 0.0
        measured = measured[(measured[:, RANGE] > 0) & (measured[:, RANGE] <= self.section.range)]
        measured = measured[: self.section.max_returns]
        measured = measured[np.argsort(measured[:, RANGE], kind="stable")]
        return self.as_returns(measured, self.propagation.snr_of_1m2(*measured[:, :VELOCITY].T))

    def _listed(self, measured: Float64, power: Float64) -> RadarReturns:
        """The returns of the largest RCS, as many as the list holds, by range."""
        inside = np.flatnonzero((measured[:, 0] > 0) & (measured[:, 0] <= self.section.range))
        rcs_m2 = power[inside] / self.propagation.snr_of_1m2(*measured[inside, :3].T)
        largest = inside[np.argsort(-rcs_m2, kind="stable")][: self.section.max_returns]
        chosen = largest[np.argsort(measured[largest, 0], kind="stable")]
        return self.as_returns(measured[chosen], power[chosen])

    @staticmethod
    def as_returns(measured: Float64, power: Float64) -> RadarReturns:
        """Returns (N,) of measurements (N, 4) and powers (N,) over the noise."""
        returns = np.empty(len(measured), RETURN_DTYPE)
        for column, name in enumerate(("range", "azimuth", "elevation", "velocity")):
            returns[name] = measured[:, column]
        returns["amplitude"] = 10 * np.log10(power)
        return returns
