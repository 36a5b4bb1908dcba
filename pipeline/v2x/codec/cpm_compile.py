"""Compiles `cpm.asn` with pycrate to `cpm_asn1.py`: `python -m advpipe.pipeline.v2x.codec.cpm_compile`."""

from __future__ import annotations

from contextlib import redirect_stdout
from importlib.resources import files
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

COMPILED = "cpm_asn1.py"


def asn1_text() -> str:
    """The ASN.1 of the collective perception message."""
    return files("advpipe.pipeline.v2x.codec").joinpath("cpm.asn").read_text(encoding="utf-8")


def compiled_source() -> str:
    """The Python module that pycrate makes of it."""
    from pycrate_asn1c.asnproc import PycrateGenerator, compile_text, generate_modules

    with TemporaryDirectory() as folder, redirect_stdout(StringIO()):
        compile_text(asn1_text())
        generate_modules(PycrateGenerator, f"{folder}/{COMPILED}")
        text = Path(folder, COMPILED).read_text(encoding="utf-8")
    return "\n".join(line.rstrip() for line in text.splitlines()).strip() + "\n"


if __name__ == "__main__":
    Path(__file__).with_name(COMPILED).write_text(compiled_source(), encoding="utf-8")
