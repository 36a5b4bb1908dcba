"""A recorded drive's messages through Artery again: the program, its configuration and its end."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from advpipe.pipeline.artery.given_link import GivenLink
from advpipe.pipeline.artery.given_medium import GivenMedium
from advpipe.pipeline.artery.process import ArteryProcess, artery_program
from advpipe.pipeline.artery.radio import GENERAL, radio_lines, seed_line, unsupported
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.progress import working_on
from advpipe.pipeline.v2x.section import Radio


class ArteryAgain:
    """Prepares Artery for the radio of a recording.

    where: the recording, for messages. seed: that of the recording. The program is the one of this machine,
    never one that a bag names. Raises UsageError where it is missing, and for what Artery's radio lacks.
    """

    def __init__(self, where: str, radio: Radio, seed: int, timeout_s: float) -> None:
        if found := list(unsupported(radio)):
            raise UsageError(
                f"{where} was recorded with {'; '.join(found)}, which Artery cannot do; attack it without "
                "--network artery"
            )
        self._program = artery_program()
        self._radio, self._seed, self._timeout_s = radio, seed, timeout_s

    @contextmanager
    def open(self) -> Iterator[GivenMedium]:
        """Artery's medium; Artery runs as long as the context."""
        with tempfile.TemporaryDirectory(prefix="advpipe-") as folder:
            link, process = GivenLink(self._timeout_s), None
            try:
                with working_on("starting Artery"):
                    self._write_configuration(Path(folder), link.port)
                    process = ArteryProcess(self._program, Path(folder))
                    link.connect(process)
                yield GivenMedium(link, self._radio.overhead_bytes)
            finally:
                if process is not None:
                    process.kill()
                link.close()

    def _write_configuration(self, folder: Path, port: int) -> None:
        lines = [
            "[General]",
            "network = advpipe.GivenWorld",
            seed_line(self._seed),
            *GENERAL,
            f"*.stations.port = {port}",
            *radio_lines(self._radio),
        ]
        (folder / "omnetpp.ini").write_text("\n".join([*lines, ""]), encoding="utf-8")
