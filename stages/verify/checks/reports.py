"""Whether reports are about the bags that lie beside them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from advpipe.pipeline.dataset.layout import REPORT_NAME
from advpipe.stages.verify.checks.base import FolderCheck
from advpipe.stages.verify.result import Fault, Result

LIMIT_BYTES = 1 << 28


class Reports(FolderCheck):
    """A report states the SHA-256 of each bag that it compared."""

    def check(self) -> Iterator[Result]:
        if self.subject.layout is None:
            return
        real = {bag.path.name: bag for bag in self.subject.bags}
        for folder in self.subject.layout.reports:
            path = folder / REPORT_NAME
            where = self.subject.place(path)
            try:
                stated = _stated(path)
            except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
                yield Fault(where, "is no report of advpipe's")
                continue
            for name, sha256 in stated.items():
                if name not in real:
                    yield Fault(where, f"compares {name}, which is not in the data set")
                elif real[name].sha256 != sha256:
                    yield Fault(where, f"was made from another {name} than the one in the data set")


def _stated(path: Path) -> dict[str, str]:
    """The checksums by the bags' names; of random baselines there are none."""
    if path.stat().st_size > LIMIT_BYTES:
        raise ValueError("too large")
    origin: dict[str, Any] = json.loads(path.read_bytes())["provenance"]
    stated = {Path(origin["clean"]["bag"]).name: origin["clean"]["sha256"]}
    stated |= {each["bag"]: each["sha256"] for each in origin["compared"] if each["sha256"] is not None}
    return stated
