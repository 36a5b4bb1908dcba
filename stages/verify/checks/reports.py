"""Whether reports were made from the bags beside them."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.dataset.layout import REPORT_NAME
from advpipe.pipeline.dataset.reports import read_report
from advpipe.stages.verify.checks.base import FolderCheck
from advpipe.stages.verify.result import Fault, Result


class Reports(FolderCheck):
    """Compares the SHA-256 of bags in each report with the bags."""

    def check(self) -> Iterator[Result]:
        if self.subject.layout is None:
            return
        real = {bag.path.name: bag for bag in self.subject.bags}
        for folder in self.subject.layout.reports:
            path = folder / REPORT_NAME
            where = self.subject.place(path)
            try:
                report = read_report(path)
            except AdvpipeError as error:
                yield Fault(where, str(error))
                continue
            for name, sha256 in report.bags.items():
                if name not in real:
                    yield Fault(where, f"compares {name}, which is not in the data set")
                elif real[name].sha256 not in (sha256, None):
                    yield Fault(where, f"was made from a {name} that differs from the one in the data set")
            known = {bag.sha256 for bag in real.values()}
            if None not in known and report.clean_sha256s - known:
                yield Fault(where, "was made from another clean bag than the one in the data set")
