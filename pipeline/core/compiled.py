"""C sources of this package as shared libraries, compiled once for this machine's processor."""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

FLAGS = ("-std=c11", "-O3", "-march=native", "-shared", "-fPIC")
TIMEOUT_S = 120
OFF = "ADVPIPE_NO_COMPILER"
"""With this variable, nothing is compiled."""


@cache
def compiled_library(source: Path) -> ctypes.CDLL | None:
    """The library of a C source, from the user's cache folder if it is there already.

    None without a C compiler (`CC`, `cc`, `gcc` or `clang`), where it fails, or where no folder of the user
    holds the library: the caller then needs another way.
    """
    if (compiler := c_compiler()) is None or (folder := _cache_folder()) is None:
        return None
    made_of = "\0".join([source.read_text(encoding="utf-8"), compiler, *FLAGS, _processor()])
    library = folder / f"{source.stem}-{hashlib.sha256(made_of.encode()).hexdigest()[:32]}.so"
    try:
        if not library.exists():
            _compile(compiler, source, library)
        return ctypes.CDLL(str(library))
    except (OSError, subprocess.SubprocessError):
        return None


def c_compiler() -> str | None:
    """The path of the C compiler that is used; None without one, or if the environment forbids it."""
    if os.environ.get(OFF):
        return None
    candidates = (os.environ.get("CC"), "cc", "gcc", "clang")
    return next((found for each in candidates if each and (found := shutil.which(each))), None)


def _compile(compiler: str, source: Path, library: Path) -> None:
    """Several processes may do so at once: each has a file of its own until it is complete."""
    with tempfile.TemporaryDirectory(dir=library.parent, prefix=".") as folder:
        made = Path(folder) / library.name
        command = [compiler, *FLAGS, str(source), "-o", str(made)]
        subprocess.run(command, check=True, capture_output=True, timeout=TIMEOUT_S)
        os.replace(made, library)


def _cache_folder() -> Path | None:
    """A folder that only this user can write to: what lies there is loaded as code."""
    try:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "advpipe"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        about = folder.stat()
    except (OSError, RuntimeError):  # no home folder
        return None
    is_ours = not hasattr(os, "getuid") or about.st_uid == os.getuid()
    return folder if is_ours and not about.st_mode & 0o022 and os.access(folder, os.W_OK) else None


def _processor() -> str:
    """What decides which instructions the processor has: a home folder may be shared by several machines."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    names = ("vendor_id", "cpu family", "model", "flags", "CPU ", "Features")
    return "\n".join(sorted({line for line in lines if line.startswith(names)}))
