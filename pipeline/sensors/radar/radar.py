"""A radar at the level of detections: what it sees of a scene in one scan.

Scattering points on road users and on all else, with occlusion by ray casting (Buehren and Yang, Simulation of
automotive radar target lists using a novel approach of object representation, IV 2006), go through the
radar equation into resolution cells; cells with noise that exceed the threshold of a CFAR, and are peaks, are
detections. Not modelled: sidelobes, masking by strong targets in the CFAR's window, interference by other radars
(see the attack `radar-jam`), and paths by way of the road beneath other vehicles.
"""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.messages.radar import RETURN_DTYPE, RadarReturns
from advpipe.pipeline.sensors.radar import detection
from advpipe.pipeline.sensors.radar.aim import Aim, Aiming
from advpipe.pipeline.sensors.radar.mirrors import barrier_facets, mirror_images
from advpipe.pipeline.sensors.radar.propagation import Propagation
from advpipe.pipeline.sensors.radar.resolution import are_peaks, fill_cells, folded, resolutions
from advpipe.pipeline.sensors.radar.scatterers import Scatterers, scatterers_of
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.pipeline.sensors.weather import Weather
from advpipe.pipeline.sensors.world import Hits


class Radar:
    """One sensor in given weather. period_s: time between its scans."""

    def __init__(self, section: RadarSensor, period_s: float, weather: Weather | None = None) -> None:
        self.section = section
        self.propagation = Propagation(section, weather or Weather())
        self.base_SE3_radar: Float64 = se3_from_yaw(
            [section.x_m, section.y_m, section.z_m], *np.deg2rad([section.yaw_deg, section.pitch_deg])
        )
        self._aiming = Aiming(section, period_s)
        self._width = resolutions(section)
        self._alpha = detection.threshold_factor(section.false_alarm_probability, section.cfar_cells)

    def aim(self, boxes: Boxes, rng: np.random.Generator) -> Aim:
        """The rays of a scan, at boxes in the radar's frame and at all else."""
        return self._aiming.draw(boxes, rng)

    def scatterers(
        self, aim: Aim, hits: Hits, boxes: Boxes, turn_rate_radps: Float64, rng: np.random.Generator
    ) -> Scatterers:
        """What the rays hit, with mirror images in guard rails; boxes and results in the radar's frame."""
        direct = scatterers_of(aim, hits, boxes, turn_rate_radps, rng)
        facets = barrier_facets(aim, hits) if self.section.guard_rail_reflection else np.zeros((0, 2, 2))
        return direct + mirror_images(direct, boxes, facets, self.section.guard_rail_reflection)

    def measure(
        self, scatterers: Scatterers, velocity_mps: Float64, rng: np.random.Generator
    ) -> RadarReturns:
        """The detections (K,) of one scan, by range, with false alarms.

        velocity_mps: (3,) of the radar over the ground, in its own axes.
        """
        section = self.section
        measured, signal = self._signals(scatterers, velocity_mps)
        cells = fill_cells(section, measured, signal, signal * (scatterers.users >= 0))
        case = np.where(cells.of_users > cells.signal / 2, section.swerling, 1)
        factors = [detection.fluctuation(each, len(case), rng) for each in (0, 1, 3)]
        power = detection.received_power(cells.signal * np.choose(np.minimum(case, 2), factors), rng)
        limits = detection.thresholds(self._alpha, section.cfar_cells, len(power), rng)
        detected = power > limits
        power, centre = power[detected], cells.centre[detected]
        peaks = are_peaks(section, centre, power)
        power, centre = power[peaks], centre[peaks]
        width = np.where(np.isfinite(self._width), self._width, 0.0)
        noise = rng.standard_normal(centre.shape) * width / np.sqrt(2 * power)[:, None]
        false_powers, false_alarms = self._false_alarms(rng)
        powers = np.concatenate([power, false_powers])
        return self._listed(np.concatenate([folded(section, centre + noise), false_alarms]), powers)

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

    def _false_alarms(self, rng: np.random.Generator) -> tuple[Float64, Float64]:
        """Powers (F,) and measurements (F, 4) of noise that exceeds the threshold."""
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

    def _listed(self, measured: Float64, power: Float64) -> RadarReturns:
        """The strongest returns, as many as the list holds, by range."""
        inside = np.flatnonzero((measured[:, 0] > 0) & (measured[:, 0] <= self.section.range))
        strongest = inside[np.argsort(-power[inside], kind="stable")][: self.section.max_returns]
        chosen = strongest[np.argsort(measured[strongest, 0], kind="stable")]
        returns = np.empty(len(chosen), RETURN_DTYPE)
        for column, name in enumerate(("range", "azimuth", "elevation", "velocity")):
            returns[name] = measured[chosen, column]
        returns["amplitude"] = 10 * np.log10(power[chosen])
        return returns
