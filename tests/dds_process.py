"""DDS domains, and subscribers in processes of their own, for tests of live publishers."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

_numbers = count()
SUBSCRIBER = Path(__file__).with_name("dds_subscriber.py")


def new_domain() -> int:
    """A DDS domain that no other test uses, below the ports that a system hands out."""
    return 1 + (os.getpid() * 7 + next(_numbers)) % 100


@contextmanager
def dds_subscriber(
    domain: int, *topics: tuple[str, str, str], slow_s: float = 0, security: str = "", patience_s: float = 60
) -> Iterator[Any]:
    """A subscriber in another process; yields a function that waits for its end and returns what it saw."""
    wanted = [word for topic in topics for word in ("--topic", *topic)]
    command = [sys.executable, str(SUBSCRIBER), str(domain), *wanted, "--slow", str(slow_s)]
    command += ["--security", security, "--patience", str(patience_s)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline()) == {"ready": True}

        def seen() -> tuple[list[dict[str, Any]], dict[str, Any]]:
            """The samples, and the publications by topic."""
            text, _ = process.communicate(timeout=90)
            *samples, last = map(json.loads, text.splitlines())
            return samples, last["publications"]

        try:
            yield seen
        finally:
            process.kill()
