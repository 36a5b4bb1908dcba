"""The user's options for sharing a data set."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.licence import check_licence

_CITATION_LIMIT_BYTES = 100_000


@dataclass(frozen=True)
class ShareOptions:
    """licence: an SPDX identifier or expression. citation: text. sign: a private key in PEM."""

    licence: str | None = None
    citation: str | None = None
    sign: Path | None = None
    split_size_bytes: int | None = None
    overwrite: bool = False

    def __post_init__(self) -> None:
        if self.licence is not None:
            check_licence(self.licence)


DEFAULT_OPTIONS = ShareOptions()


def citation_text(text_or_file: str | None) -> str | None:
    """The text, or the contents of the file that it names.

    Raises UsageError for text or a file that is not valid UTF-8, and for too large a file.
    """
    if text_or_file is None:
        return None
    path = Path(text_or_file)
    try:
        text_or_file.encode()
    except UnicodeEncodeError:  # bytes that are invalid in the locale arrive as lone surrogates
        raise UsageError("--citation is not valid UTF-8 text; set LC_ALL=C.UTF-8, or name a file") from None
    try:
        if "\n" in text_or_file or not path.is_file():
            return text_or_file
        if path.stat().st_size > _CITATION_LIMIT_BYTES:
            raise UsageError(f"{path} is too large for a citation")
        return path.read_text(encoding="utf-8").strip()
    except UnicodeDecodeError:
        raise UsageError(f"{path} is not valid UTF-8 text") from None
    except OSError:  # too long for a file name, so it is text
        return text_or_file
