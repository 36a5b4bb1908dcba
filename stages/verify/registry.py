"""The checks by name, in the order in which they run and are reported."""

from __future__ import annotations

from advpipe.stages.verify.checks.base import BagCheck, FolderCheck
from advpipe.stages.verify.checks.beside import FilesBeside
from advpipe.stages.verify.checks.boxes import BoxesHoldPoints
from advpipe.stages.verify.checks.cams import CamsCheck
from advpipe.stages.verify.checks.checksums import Checksums
from advpipe.stages.verify.checks.container import Container
from advpipe.stages.verify.checks.copies import Copies
from advpipe.stages.verify.checks.crcs import Crcs
from advpipe.stages.verify.checks.debug_topics import DebugTopics
from advpipe.stages.verify.checks.fixes import Fixes
from advpipe.stages.verify.checks.images import Images
from advpipe.stages.verify.checks.leaks import Leaks
from advpipe.stages.verify.checks.metadata import MetadataYaml
from advpipe.stages.verify.checks.points import Points
from advpipe.stages.verify.checks.provenance import ProvenanceCheck
from advpipe.stages.verify.checks.qos import QualityOfService
from advpipe.stages.verify.checks.rates import Rates
from advpipe.stages.verify.checks.receptions import ReceptionsCheck
from advpipe.stages.verify.checks.reports import Reports
from advpipe.stages.verify.checks.scans import Scans
from advpipe.stages.verify.checks.scenario import ScenarioFiles
from advpipe.stages.verify.checks.signature import Signature
from advpipe.stages.verify.checks.time import Time
from advpipe.stages.verify.checks.transforms import Transforms
from advpipe.stages.verify.checks.types import Types

CHECKS: dict[str, type[FolderCheck] | type[BagCheck]] = {
    "checksums": Checksums,
    "signature": Signature,
    "crcs": Crcs,
    "reports": Reports,
    "container": Container,
    "metadata": MetadataYaml,
    "beside": FilesBeside,
    "scenario": ScenarioFiles,
    "provenance": ProvenanceCheck,
    "types": Types,
    "qos": QualityOfService,
    "rates": Rates,
    "time": Time,
    "transforms": Transforms,
    "boxes": BoxesHoldPoints,
    "receptions": ReceptionsCheck,
    "copies": Copies,
    "points": Points,
    "cams": CamsCheck,
    "fixes": Fixes,
    "scans": Scans,
    "images": Images,
    "debug": DebugTopics,
    "audit": Leaks,
}

QUICK = ("checksums", "signature", "crcs")
"""The checks that read every byte once without decompressing chunks."""

QUICK_ALONE = (*QUICK, "beside")
"""The quick checks without SHA256SUMS, where checksums in the bags protect the files beside them."""
