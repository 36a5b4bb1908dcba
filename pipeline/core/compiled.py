"""C sources of this package as shared libraries, compiled once for this machine's processor."""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import stat
import subprocess
import tempfile
from functools import cache
from pathlib import Path

# ISO C forbids fused multiplications and additions unless they are asked for.
FLAGS = ("-std=c11", "-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC")
TIMEOUT_S = 120
OFF = "ADVPIPE_NO_COMPILER"
"""With this variable, nothing is compiled."""


@cache
def compiled_library(source: Path) -> ctypes.CDLL | None:
    """The library of a C source, from the user's cache folder if it is there already.

    None without a C compiler (see `c_compiler`), where it fails, or where no folder of the user holds the
    library: the caller then needs another way.
    """
    try:
        if not (compiler := c_compiler()) or (folder := _cache_folder()) is None:
            return None
        text = source.read_text(encoding="utf-8")
        made_of = "\0".join([text, *compiler, compiler_version() or "", *FLAGS, _processor()])
        name = f"{source.stem}-{hashlib.sha256(os.fsencode(made_of)).hexdigest()[:16]}"
        return ctypes.CDLL(str(_kept(folder, name) or _compile(compiler, source, folder, name)))
    except (OSError, subprocess.SubprocessError):
        return None


def c_compiler() -> list[str]:
    """The command of the C compiler: that of `CC`, or else cc, gcc or clang. Empty without one, or if the
    environment forbids it."""
    if os.environ.get(OFF):
        return []
    try:
        wanted = shlex.split(os.environ.get("CC", ""))
    except ValueError:
        wanted = []
    for command in (wanted, ["cc"], ["gcc"], ["clang"]):
        if command and (found := shutil.which(command[0])):
            return [found, *command[1:]]
    return []


@cache
def compiler_version() -> str | None:
    """What the C compiler says about itself, in a line; None without one."""
    try:
        command = [*c_compiler(), "--version"]
        said = subprocess.run(command, check=True, capture_output=True, timeout=TIMEOUT_S).stdout
    except (OSError, subprocess.SubprocessError):
        return None
    return next(iter(said.decode(errors="replace").splitlines()), "")


def _kept(folder: Path, name: str) -> Path | None:
    """The library in the folder, of which none but this user may have written a byte; damaged ones go."""
    for library in sorted(folder.glob(f"{name}-*.so")):
        if _is_ours(library) and library == _named(folder, name, library.read_bytes()):
            return library
        library.unlink(missing_ok=True)
    return None


def _compile(compiler: list[str], source: Path, folder: Path, name: str) -> Path:
    """Several processes may do so at once: each has a file of its own until it is complete."""
    with tempfile.TemporaryDirectory(dir=folder, prefix=".") as scratch:
        made = Path(scratch) / f"{name}.so"
        command = [*compiler, *FLAGS, str(source), "-o", str(made)]
        subprocess.run(command, check=True, capture_output=True, timeout=TIMEOUT_S)
        made.chmod(0o700)
        library = _named(folder, name, made.read_bytes())
        os.replace(made, library)
    return library


def _named(folder: Path, name: str, content: bytes) -> Path:
    """The place of a library, with its checksum: one that was cut off may kill the process that loads it."""
    return folder / f"{name}-{hashlib.sha256(content).hexdigest()[:16]}.so"


def _cache_folder() -> Path | None:
    """A folder that only this user can write to: what lies there is loaded as code."""
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        folder = (base if base.is_absolute() else Path.home() / ".cache") / "advpipe"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # no home folder
        return None
    return folder if _is_ours(folder) and os.access(folder, os.W_OK) else None


def _is_ours(path: Path) -> bool:
    """Whether it is no link, belongs to this user, and nobody else may write to it."""
    about = path.lstat()
    is_own = not hasattr(os, "getuid") or about.st_uid == os.getuid()
    return is_own and not stat.S_ISLNK(about.st_mode) and not about.st_mode & 0o022


def _processor() -> str:
    """What decides which instructions the processor has: a home folder may be shared by several machines."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    names = ("vendor_id", "cpu family", "model", "flags", "CPU ", "Features")
    return "\n".join(sorted({line for line in lines if line.startswith(names)}))
