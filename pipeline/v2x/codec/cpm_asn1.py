"""The ASN.1 of the collective perception message, `cpm.asn`, compiled by pycrate when it is first needed."""

from __future__ import annotations

from contextlib import redirect_stdout
from functools import cache
from importlib.resources import files
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any


def asn1_text() -> str:
    """The ASN.1 of the collective perception message."""
    return files("advpipe.pipeline.v2x.codec").joinpath("cpm.asn").read_text(encoding="utf-8")


@cache
def cpm_types() -> Any:
    """The class whose attributes are pycrate's objects of the message's types; compiled in 0.2 s."""
    from pycrate_asn1c.asnproc import PycrateGenerator, compile_text, generate_modules

    with TemporaryDirectory() as folder, redirect_stdout(StringIO()):
        compile_text(asn1_text())
        generate_modules(PycrateGenerator, f"{folder}/module.py")
        source = Path(folder, "module.py").read_text(encoding="utf-8")
    module: dict[str, Any] = {}
    exec(source, module)
    return module["AdvpipeCollectivePerception"]
