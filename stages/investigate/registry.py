"""All cues by name."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.stages.investigate.cue import Cue
from advpipe.stages.investigate.cues.cam_plausibility import CamPlausibilityCue
from advpipe.stages.investigate.cues.cam_surroundings import CamSurroundingsCue
from advpipe.stages.investigate.cues.cpm_objects import CpmObjectsCue
from advpipe.stages.investigate.cues.free_space import FreeSpaceCue
from advpipe.stages.investigate.cues.gnss_innovation import GnssInnovationCue
from advpipe.stages.investigate.cues.gnss_lanes import GnssLanesCue
from advpipe.stages.investigate.cues.gnss_motion import GnssMotionCue
from advpipe.stages.investigate.cues.lidar_density import LidarDensityCue
from advpipe.stages.investigate.cues.lidar_order import LidarOrderCue
from advpipe.stages.investigate.cues.lidar_rays import LidarRaysCue
from advpipe.stages.investigate.cues.lidar_temporal import LidarTemporalCue
from advpipe.stages.investigate.cues.lidar_tracks import LidarTracksCue
from advpipe.stages.investigate.cues.power_distance import PowerDistanceCue

CUES: Mapping[str, type[Cue]] = {
    "cam-plausibility": CamPlausibilityCue,
    "cam-surroundings": CamSurroundingsCue,
    "cpm-objects": CpmObjectsCue,
    "free-space": FreeSpaceCue,
    "power-distance": PowerDistanceCue,
    "gnss-innovation": GnssInnovationCue,
    "gnss-motion": GnssMotionCue,
    "gnss-lanes": GnssLanesCue,
    "lidar-rays": LidarRaysCue,
    "lidar-order": LidarOrderCue,
    "lidar-density": LidarDensityCue,
    "lidar-temporal": LidarTemporalCue,
    "lidar-tracks": LidarTracksCue,
}
