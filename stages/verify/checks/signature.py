"""Whether SHA256SUMS is what its signer signed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from advpipe.pipeline.dataset import signature
from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.verify.checks.base import FolderCheck
from advpipe.stages.verify.result import Fault, Gap, Result


class Signature(FolderCheck):
    """By the key that the user gave, or by the one that lies beside: that tells damage, not who signed."""

    key: Path | None = None

    def check(self) -> Iterator[Result]:
        root = self.subject.root
        is_signed = (root / signature.FILE).exists()
        if not is_signed and self.key is None:
            return
        try:
            signature.verify(root, self.key)
        except AdvpipeError as error:
            yield Fault(signature.FILE, str(error))
            return
        if self.key is None:
            yield Gap(
                signature.FILE, f"right by {signature.KEY_FILE}, which anyone can have put there; pass --key"
            )
