"""advpipe: adversarial attacks on autonomous vehicles; `advpipe --help` lists the commands.

Importing it loads nothing heavy.
"""

from __future__ import annotations

__all__ = ["__version__"]

__version__: str


def __getattr__(name: str) -> object:
    if name == "__version__":
        from advpipe.pipeline.core.versions import installed

        return installed("advpipe")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
