"""What tests read of bags with attacked cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import RawMessage

FRONT, REAR = "/ego/front/image/compressed", "/ego/rear/image/compressed"


def images(bag: Path, topic: str = FRONT) -> list[RawMessage]:
    return list(BagReader(bag).raw_messages([topic]))


def labels(bag: Path) -> list[dict[str, Any]]:
    return pq.read_table(bag / "camera_labels.parquet").to_pylist()


def same(one: RawMessage, other: RawMessage) -> bool:
    """Whether two messages agree in their bytes and times."""
    return (one.cdr, one.log_time_ns, one.publish_time_ns) == (
        *(other.cdr, other.log_time_ns, other.publish_time_ns),
    )
