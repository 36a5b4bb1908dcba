"""From each adversarial bag to the clean bag that it was made of, by checksum."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.dataset.layout import Layout
from advpipe.pipeline.errors import AdvpipeError


def check_chain(layout: Layout, clean_sha256: str) -> list[str]:
    """Raises AdvpipeError for an adversarial bag of another parent; returns what cannot be checked.

    clean_sha256: `parent_sha256` of the clean bag.
    """
    if BagReader(layout.clean).provenance.get("kind") == "attack":
        raise AdvpipeError(f"{layout.clean} is an adversarial bag; a data set's clean bag is no attack")
    return [remark for bag in layout.attacks if (remark := _check(bag, clean_sha256))]


def _check(bag: Path, clean_sha256: str) -> str:
    stated = BagReader(bag).provenance.get("parent_sha256")
    if stated is None:
        return f"{bag.name} does not say which bag it was made from"
    if stated != clean_sha256:
        raise AdvpipeError(
            f"{bag} was made from another bag (parent SHA-256 {stated[:12]}…) than this data set's clean one "
            f"({clean_sha256[:12]}…); attack that again with --overwrite, or move this bag elsewhere"
        )
    return ""
