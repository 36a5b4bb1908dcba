"""The files that sharing adds to a data set, by their paths in it."""

from __future__ import annotations

from advpipe.pipeline.dataset import checksums, signature
from advpipe.pipeline.dataset.layout import CARD_NAME

CHECKS, FIGURES, PLAY, MESSAGES = "checks", "figures", "play", "msgs"
FOLDERS = (CHECKS, FIGURES, PLAY, MESSAGES)
FILES = (CARD_NAME, checksums.FILE, signature.FILE, signature.KEY_FILE)

CARD_MARK = "<!-- made by advpipe share -->"


def is_made(name: str) -> bool:
    """Whether sharing generates this file, so that an old one is not copied."""
    return name in FILES or name.split("/")[0] in FOLDERS


def baglint_name(bag: str) -> str:
    """The path of a bag's baglint specification."""
    return f"{CHECKS}/{bag}.baglint.yaml"


def tracecheck_name(bag: str) -> str:
    """The path of a bag's Tracecheck contract."""
    return f"{CHECKS}/{bag}.tracecheck.json"
