"""advpipe: adversarial attacks on autonomous vehicles; simulate a drive, attack it, measure the damage.

>>> import advpipe
>>> drive = advpipe.simulate("smoke")
>>> detached = advpipe.attack(drive, type="detach", ratio=0.01)
>>> advpipe.evaluate(drive, detached).to_pandas()

The functions are the commands of `advpipe --help`, with the same names, defaults and units. Beside them are
the protocols and base classes for attacks, defences, detectors, sensors and back ends of your own, and what
these need; `advpipe.networks` has the parts of detectors that `train` trains. Importing advpipe loads nothing
heavy: a name is loaded when it is first used.
"""

from __future__ import annotations

TYPE_CHECKING = False  # as typing has it, which takes its time to load

if TYPE_CHECKING:
    from advpipe.bag import Bag as Bag
    from advpipe.bag import open_bag as open_bag
    from advpipe.commands.attack import attack as attack
    from advpipe.commands.evaluate import evaluate as evaluate
    from advpipe.commands.grid import grid as grid
    from advpipe.commands.import_drive import import_drive as import_drive
    from advpipe.commands.investigate import investigate as investigate
    from advpipe.commands.play import play as play
    from advpipe.commands.relay import relay as relay
    from advpipe.commands.simulate import simulate as simulate
    from advpipe.commands.sweep import sweep as sweep
    from advpipe.commands.train import train as train
    from advpipe.commands.train_camera import train_camera as train_camera
    from advpipe.commands.verify import verify as verify
    from advpipe.pipeline.adversary.targets import AttackTargets as AttackTargets
    from advpipe.pipeline.adversary.targets import detection_loss as detection_loss
    from advpipe.pipeline.adversary.targets import find_targets as find_targets
    from advpipe.pipeline.attack_detection.base import AttackCheck as AttackCheck
    from advpipe.pipeline.attack_detection.base import CheckNotApplicableError as CheckNotApplicableError
    from advpipe.pipeline.attack_detection.base import DefenderKnowledge as DefenderKnowledge
    from advpipe.pipeline.attack_detection.base import Suspicion as Suspicion
    from advpipe.pipeline.bag.frames import Frame as Frame
    from advpipe.pipeline.bag.reader import BagReader as BagReader
    from advpipe.pipeline.campaigns.grid.run import GridReport as GridReport
    from advpipe.pipeline.campaigns.relay.summary import RelaySummary as RelaySummary
    from advpipe.pipeline.campaigns.sweep.run import SweepReport as SweepReport
    from advpipe.pipeline.core.errors import AdvpipeError as AdvpipeError
    from advpipe.pipeline.core.errors import UsageError as UsageError
    from advpipe.pipeline.core.seeding import named_generator as named_generator
    from advpipe.pipeline.defences.base import Defence as Defence
    from advpipe.pipeline.defences.base import DefendedCloud as DefendedCloud
    from advpipe.pipeline.defences.base import Placement as Placement
    from advpipe.pipeline.detector.expected_input import ExpectedInput as ExpectedInput
    from advpipe.pipeline.detector.protocol import BatchDetector as BatchDetector
    from advpipe.pipeline.detector.protocol import Detections as Detections
    from advpipe.pipeline.detector.protocol import ObjectDetector as ObjectDetector
    from advpipe.pipeline.detector.protocol import Range as Range
    from advpipe.pipeline.detector.protocol import VoxelDetector as VoxelDetector
    from advpipe.pipeline.detector.registry import load_detector as load_detector
    from advpipe.pipeline.geometry.boxes import BOX_COLUMNS as BOX_COLUMNS
    from advpipe.pipeline.geometry.boxes import CLASSES as CLASSES
    from advpipe.pipeline.geometry.boxes import Boxes as Boxes
    from advpipe.pipeline.geometry.transforms import se3_from_yaw as se3_from_yaw
    from advpipe.pipeline.image_detector.protocol import (
        DifferentiableImageDetector as DifferentiableImageDetector,
    )
    from advpipe.pipeline.image_detector.protocol import ImageDetections as ImageDetections
    from advpipe.pipeline.image_detector.protocol import ImageDetector as ImageDetector
    from advpipe.pipeline.image_detector.registry import image_detector_named as image_detector_named
    from advpipe.pipeline.labels.cloud_quantity import CloudQuantity as CloudQuantity
    from advpipe.pipeline.labels.points import PointLabels as PointLabels
    from advpipe.pipeline.localisation.estimate import Estimate as Estimate
    from advpipe.pipeline.localisation.geodesy import Geodesy as Geodesy
    from advpipe.pipeline.mcap.channel import Topic as Topic
    from advpipe.pipeline.mcap.qos import keep_last as keep_last
    from advpipe.pipeline.messages.build import message_header as message_header
    from advpipe.pipeline.messages.cloud import POINT_DTYPE as POINT_DTYPE
    from advpipe.pipeline.messages.types import message_class as message_class
    from advpipe.pipeline.messages.types import serialise as serialise
    from advpipe.pipeline.messages.v2x import RadioPlace as RadioPlace
    from advpipe.pipeline.misbehaviour.claim import Claim as Claim
    from advpipe.pipeline.misbehaviour.claim import ReceivingVehicle as ReceivingVehicle
    from advpipe.pipeline.misbehaviour.verdicts import CheckVerdicts as CheckVerdicts
    from advpipe.pipeline.misbehaviour.verdicts import MisbehaviourDetector as MisbehaviourDetector
    from advpipe.pipeline.misbehaviour.verdicts import Verdicts as Verdicts
    from advpipe.pipeline.replay.v2x_drive import V2xDrive as V2xDrive
    from advpipe.pipeline.replay.v2x_drive import V2xStep as V2xStep
    from advpipe.pipeline.scenario.load import load_scenario as load_scenario
    from advpipe.pipeline.scenario.models import Scenario as Scenario
    from advpipe.pipeline.sensors.registry import SENSORS as SENSORS
    from advpipe.pipeline.sensors.sensor import Cadence as Cadence
    from advpipe.pipeline.sensors.sensor import DriveSettings as DriveSettings
    from advpipe.pipeline.sensors.sensor import Instant as Instant
    from advpipe.pipeline.sensors.sensor import MountedSection as MountedSection
    from advpipe.pipeline.sensors.sensor import MountedSensor as MountedSensor
    from advpipe.pipeline.sensors.sensor import OnBoardSensor as OnBoardSensor
    from advpipe.pipeline.sensors.sensor import Panel as Panel
    from advpipe.pipeline.sensors.sensor import Reading as Reading
    from advpipe.pipeline.sensors.sensor import Sensor as Sensor
    from advpipe.pipeline.sensors.world import Hits as Hits
    from advpipe.pipeline.sensors.world import Surroundings as Surroundings
    from advpipe.pipeline.v2x.channel import Received as Received
    from advpipe.pipeline.v2x.channel import Sent as Sent
    from advpipe.pipeline.v2x.codec.codec import decode_cam_tree as decode_cam_tree
    from advpipe.pipeline.v2x.codec.timestamps import generation_delta_time_ms as generation_delta_time_ms
    from advpipe.pipeline.v2x.facilities.cam import Cam as Cam
    from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam as encode_cam
    from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot as LdmSnapshot
    from advpipe.pipeline.v2x.facilities.ldm import Verdict as Verdict
    from advpipe.stages.attack.camera.base import AttackedImage as AttackedImage
    from advpipe.stages.attack.camera.base import CameraAttack as CameraAttack
    from advpipe.stages.attack.camera.base import CameraDrive as CameraDrive
    from advpipe.stages.attack.camera.base import CameraImage as CameraImage
    from advpipe.stages.attack.camera.base import CameraTraits as CameraTraits
    from advpipe.stages.attack.camera.base import ImageContext as ImageContext
    from advpipe.stages.attack.camera.base import PaintedArea as PaintedArea
    from advpipe.stages.attack.camera.base import whole_image as whole_image
    from advpipe.stages.attack.gnss.base import GnssAttack as GnssAttack
    from advpipe.stages.attack.gnss.base import GnssTraits as GnssTraits
    from advpipe.stages.attack.gnss.base import Spoofer as Spoofer
    from advpipe.stages.attack.gnss.base import SpoofingContext as SpoofingContext
    from advpipe.stages.attack.lidar.base import Budget as Budget
    from advpipe.stages.attack.lidar.base import LidarAttack as LidarAttack
    from advpipe.stages.attack.lidar.base import LidarResult as LidarResult
    from advpipe.stages.attack.lidar.base import LidarTraits as LidarTraits
    from advpipe.stages.attack.lidar.base import PublishedFigure as PublishedFigure
    from advpipe.stages.attack.lidar.base import unchanged as unchanged
    from advpipe.stages.attack.radar.base import AttackedScan as AttackedScan
    from advpipe.stages.attack.radar.base import RadarAttack as RadarAttack
    from advpipe.stages.attack.radar.base import RadarTraits as RadarTraits
    from advpipe.stages.attack.radar.base import ScanContext as ScanContext
    from advpipe.stages.attack.summary import AttackSummary as AttackSummary
    from advpipe.stages.attack.v2x.base import AttackContext as AttackContext
    from advpipe.stages.attack.v2x.base import V2xAttack as V2xAttack
    from advpipe.stages.attack.v2x.base import V2xTraits as V2xTraits
    from advpipe.stages.attack.v2x.cams import field_of as field_of
    from advpipe.stages.attack.v2x.cams import with_fields as with_fields
    from advpipe.stages.attack.v2x.falsification import Falsification as Falsification
    from advpipe.stages.attack.v2x.falsification import OwnMessage as OwnMessage
    from advpipe.stages.attack.v2x.falsification import PositionFalsification as PositionFalsification
    from advpipe.stages.evaluate.report.report import Report as Report
    from advpipe.stages.investigate.investigation import Investigation as Investigation
    from advpipe.stages.play.summary import PlaySummary as PlaySummary
    from advpipe.stages.simulate.bodies import Variant as Variant
    from advpipe.stages.simulate.network.protocol import Network as Network
    from advpipe.stages.simulate.network.protocol import NetworkStep as NetworkStep
    from advpipe.stages.simulate.road_network.network import RoadNetwork as RoadNetwork
    from advpipe.stages.simulate.road_network.roads import Roads as Roads
    from advpipe.stages.simulate.road_network.roads import lay_out_roads as lay_out_roads
    from advpipe.stages.simulate.run import SimulationSummary as SimulationSummary
    from advpipe.stages.simulate.traffic.protocol import TrafficSource as TrafficSource
    from advpipe.stages.simulate.traffic.road_users import RoadUser as RoadUser
    from advpipe.stages.simulate.traffic.road_users import boxes_of as boxes_of
    from advpipe.stages.simulate.world.protocol import World as World
    from advpipe.stages.train.run import TrainSummary as TrainSummary
    from advpipe.stages.verify.result import Verification as Verification

    __version__: str

_NAMES_OF = {
    "bag": ("Bag", "open_bag"),
    "commands.attack": ("attack",),
    "commands.evaluate": ("evaluate",),
    "commands.grid": ("grid",),
    "commands.import_drive": ("import_drive",),
    "commands.investigate": ("investigate",),
    "commands.play": ("play",),
    "commands.relay": ("relay",),
    "commands.simulate": ("simulate",),
    "commands.sweep": ("sweep",),
    "commands.train": ("train",),
    "commands.train_camera": ("train_camera",),
    "commands.verify": ("verify",),
    "pipeline.attack_detection.base": (
        *("AttackCheck", "CheckNotApplicableError", "DefenderKnowledge", "Suspicion"),
    ),
    "pipeline.bag.frames": ("Frame",),
    "pipeline.bag.reader": ("BagReader",),
    "pipeline.campaigns.grid.run": ("GridReport",),
    "pipeline.campaigns.relay.summary": ("RelaySummary",),
    "pipeline.campaigns.sweep.run": ("SweepReport",),
    "pipeline.core.errors": ("AdvpipeError", "UsageError"),
    "pipeline.core.seeding": ("named_generator",),
    "pipeline.defences.base": ("Defence", "DefendedCloud", "Placement"),
    "pipeline.detector.expected_input": ("ExpectedInput",),
    "pipeline.detector.protocol": (
        *("BatchDetector", "Detections", "ObjectDetector", "Range", "VoxelDetector"),
    ),
    "pipeline.detector.registry": ("load_detector",),
    "pipeline.geometry.boxes": ("BOX_COLUMNS", "Boxes", "CLASSES"),
    "pipeline.geometry.transforms": ("se3_from_yaw",),
    "pipeline.image_detector.protocol": (
        *("DifferentiableImageDetector", "ImageDetections", "ImageDetector"),
    ),
    "pipeline.image_detector.registry": ("image_detector_named",),
    "pipeline.labels.cloud_quantity": ("CloudQuantity",),
    "pipeline.labels.points": ("PointLabels",),
    "pipeline.localisation.estimate": ("Estimate",),
    "pipeline.localisation.geodesy": ("Geodesy",),
    "pipeline.mcap.channel": ("Topic",),
    "pipeline.mcap.qos": ("keep_last",),
    "pipeline.messages.build": ("message_header",),
    "pipeline.messages.cloud": ("POINT_DTYPE",),
    "pipeline.messages.types": ("message_class", "serialise"),
    "pipeline.messages.v2x": ("RadioPlace",),
    "pipeline.misbehaviour.claim": ("Claim", "ReceivingVehicle"),
    "pipeline.misbehaviour.verdicts": ("CheckVerdicts", "MisbehaviourDetector", "Verdicts"),
    "pipeline.replay.v2x_drive": ("V2xDrive", "V2xStep"),
    "pipeline.scenario.load": ("load_scenario",),
    "pipeline.scenario.models": ("Scenario",),
    "pipeline.sensors.registry": ("SENSORS",),
    "pipeline.sensors.sensor": (
        *("Cadence", "DriveSettings", "Instant", "MountedSection", "MountedSensor", "OnBoardSensor"),
        *("Panel", "Reading", "Sensor"),
    ),
    "pipeline.sensors.world": ("Hits", "Surroundings"),
    "pipeline.v2x.channel": ("Received", "Sent"),
    "pipeline.v2x.codec.codec": ("decode_cam_tree",),
    "pipeline.v2x.codec.timestamps": ("generation_delta_time_ms",),
    "pipeline.v2x.facilities.cam": ("Cam",),
    "pipeline.v2x.facilities.cam_tree": ("encode_cam",),
    "pipeline.v2x.facilities.ldm": ("LdmSnapshot", "Verdict"),
    "stages.attack.camera.base": (
        *("AttackedImage", "CameraAttack", "CameraDrive", "CameraImage", "CameraTraits", "ImageContext"),
        *("PaintedArea", "whole_image"),
    ),
    "stages.attack.radar.base": ("AttackedScan", "RadarAttack", "RadarTraits", "ScanContext"),
    "stages.attack.gnss.base": ("GnssAttack", "GnssTraits", "Spoofer", "SpoofingContext"),
    "stages.attack.lidar.base": (
        *("Budget", "LidarAttack", "LidarResult", "LidarTraits", "PublishedFigure", "unchanged"),
    ),
    "pipeline.adversary.targets": ("AttackTargets", "detection_loss", "find_targets"),
    "stages.attack.summary": ("AttackSummary",),
    "stages.attack.v2x.base": ("AttackContext", "V2xAttack", "V2xTraits"),
    "stages.attack.v2x.cams": ("field_of", "with_fields"),
    "stages.attack.v2x.falsification": ("Falsification", "OwnMessage", "PositionFalsification"),
    "stages.evaluate.report.report": ("Report",),
    "stages.investigate.investigation": ("Investigation",),
    "stages.play.summary": ("PlaySummary",),
    "stages.simulate.network.protocol": ("Network", "NetworkStep"),
    "stages.simulate.bodies": ("Variant",),
    "stages.simulate.road_network.network": ("RoadNetwork",),
    "stages.simulate.road_network.roads": ("Roads", "lay_out_roads"),
    "stages.simulate.run": ("SimulationSummary",),
    "stages.simulate.traffic.protocol": ("TrafficSource",),
    "stages.simulate.traffic.road_users": ("RoadUser", "boxes_of"),
    "stages.simulate.world.protocol": ("World",),
    "stages.train.run": ("TrainSummary",),
    "stages.verify.result": ("Verification",),
}
"""Where the names are that are loaded when they are first used; type checkers read the imports above."""

_MODULE_OF = {name: module for module, names in _NAMES_OF.items() for name in names}

__all__ = ["__version__", *_MODULE_OF]


def __getattr__(name: str) -> object:
    if name == "__version__":
        from advpipe.pipeline.core.versions import installed

        return installed("advpipe")
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    found = globals()[name] = getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
