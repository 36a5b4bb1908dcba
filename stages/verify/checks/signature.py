"""Whether the signature of SHA256SUMS is valid."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.dataset import signature
from advpipe.stages.verify.checks.base import FolderCheck
from advpipe.stages.verify.result import Fault, Result, Unchecked


class Signature(FolderCheck):
    """Checks with the user's key, or with the data set's key, which reveals damage but does not identify the
    signer."""

    def check(self) -> Iterator[Result]:
        root, key = self.subject.root, self.subject.key
        is_signed = (root / signature.FILE).exists()
        if not is_signed and key is None:
            return
        try:
            signature.verify_signature(root, key)
        except signature.NoLibraryError as error:
            yield Unchecked(signature.FILE, str(error))
            return
        except AdvpipeError as error:
            yield Fault(signature.FILE, str(error))
            return
        if key is None:
            yield Unchecked(
                signature.FILE,
                f"valid for {signature.KEY_FILE}, which anyone could have added; pass {option_name('key')}",
            )
