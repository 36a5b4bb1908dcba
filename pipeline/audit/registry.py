"""All probes; each has one line here and is tried on every data set that has its units."""

from __future__ import annotations

from typing import Any

from advpipe.pipeline.audit.chunk_probes import CHUNK_PROBES
from advpipe.pipeline.audit.fix_probes import FIX_PROBES
from advpipe.pipeline.audit.image_probes import IMAGE_PROBES
from advpipe.pipeline.audit.lidar_probes import CLOUD_PROBES, POINT_PROBES
from advpipe.pipeline.audit.message_probes import CPM_PROBES, MESSAGE_PROBES, STATION_PROBES
from advpipe.pipeline.audit.probe import Probe
from advpipe.pipeline.audit.scan_probes import RETURN_PROBES, SCAN_PROBES

PROBES: tuple[Probe[Any], ...] = (
    *CLOUD_PROBES,
    *POINT_PROBES,
    *MESSAGE_PROBES,
    *STATION_PROBES,
    *CPM_PROBES,
    *FIX_PROBES,
    *SCAN_PROBES,
    *RETURN_PROBES,
    *IMAGE_PROBES,
    *CHUNK_PROBES,
)
