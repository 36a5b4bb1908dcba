"""The provenance chain, by checksum: each adversarial bag to its drive, and each report to its bags."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.dataset.layout import REPORT_NAME, Layout
from advpipe.pipeline.dataset.reports import read_report


def check_chain(layout: Layout, sha256_of_bags: Mapping[str, str]) -> list[str]:
    """Check the chain; return a warning for each bag that cannot be checked.

    sha256_of_bags: `parent_sha256` by the bag's name. Raises AdvpipeError for an adversarial bag whose drive
    is not in the data set, and for a report on other bags.
    """
    records = {bag: BagReader(bag).provenance for bag in layout.bags}
    attacks = {bag: record for bag, record in records.items() if record.is_attack}
    if layout.clean in attacks:
        raise AdvpipeError(
            f"{layout.clean} is an adversarial bag; a data set's clean bag must not be an attack"
        )
    drives = {sha256_of_bags[bag.name] for bag in records if bag not in attacks}
    warnings = [warning for bag, record in attacks.items() if (warning := _check_bag(bag, record, drives))]
    for report in layout.reports:
        _check_report(report / REPORT_NAME, sha256_of_bags)
    return warnings


def _check_report(path: Path, sha256_of_bags: Mapping[str, str]) -> None:
    report = read_report(path)
    for bag, stated in report.bags.items():
        if bag not in sha256_of_bags:
            raise AdvpipeError(
                f"{path} compares {bag}, which is not in the data set; move the report elsewhere"
            )
        if stated != sha256_of_bags[bag]:
            raise AdvpipeError(
                f"{path} was made from a {bag} that differs from the one in the data set; evaluate "
                "again with "
                "--overwrite"
            )
    if report.clean_sha256s - set(sha256_of_bags.values()):
        raise AdvpipeError(
            f"{path} was made from another clean bag than the one in the data set; move the report elsewhere"
        )


def _check_bag(bag: Path, record: Provenance, drives: Collection[str]) -> str:
    stated = record.fields.parent_sha256
    if stated is None:
        return f"{bag.name} does not record which bag it was made from"
    if stated not in drives:
        raise AdvpipeError(
            f"{bag} was made from another bag (parent SHA-256 {stated[:12]}…) than this data set's clean one "
            f"({', '.join(f'{drive[:12]}…' for drive in sorted(drives))}); attack that drive again with "
            "--overwrite, or move this bag elsewhere"
        )
    return ""
