"""Options that several commands share."""

from __future__ import annotations

from typing import Annotated

import typer

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an output that exists.")]
DetectorName = Annotated[
    str, typer.Option("--detector", help="A shipped name, a .safetensors file, or module:Class.")
]
