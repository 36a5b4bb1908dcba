"""States in one line what to install where a library that advpipe needs is missing or damaged.

`python -m advpipe.pipeline.core.missing_library` loads every library once; `make install` ends with it.
"""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

DEBIAN_PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXrender.so.1": "libxrender1",
    "libatomic.so.1": "libatomic1",
    "libexpat.so.1": "libexpat1",
    "libgcc_s.so.1": "libgcc-s1",
    "libgomp.so.1": "libgomp1",
    "libidn2.so.0": "libidn2-0",
    "libstdc++.so.6": "libstdc++6",
    "libudev.so.1": "libudev1",
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libz.so.1": "zlib1g",
}
"""The Debian and Ubuntu package of each shared library that the wheels of our dependencies take from the
system, the C library's own aside. Found by loading them on a Debian that has nothing else."""

PIP_PACKAGES = {
    "foxglove": "foxglove-sdk",
    "google": "protobuf",
    "mpl_toolkits": "matplotlib",
    "open3d": "open3d-cpu",
    "PIL": "pillow",
    "pycrate_asn1dir": "pycrate",
    "pycrate_asn1rt": "pycrate",
    "pycrate_core": "pycrate",
    "sklearn": "scikit-learn",
    "sumo": "eclipse-sumo",
    "yaml": "pyyaml",
}
"""Packages on PyPI whose modules have another name."""

EXTRAS = {
    "carla": "carla",
    "cryptography": "sign",
    "cyclonedds": "ros2",
    "foxglove": "foxglove",
    "ray": "cluster",
}
"""Modules that are installed only with an extra of advpipe."""

_ABSENT = re.compile(r"([^\s:]+): cannot open shared object file: No such file or directory")
_DAMAGED = re.compile(
    r"(\S+): (file too short|invalid ELF header|wrong ELF class: \w+|cannot read file data[^\n]*"
    r"|cannot open shared object file: (?!No such file)[^\n]+)"
)
_OLD_SYSTEM = re.compile(r"version [`'](\w+?_[\d.]+)' not found \(required by ([^)\s]+)\)")
_ABSENT_ON_MACOS = re.compile(r"Library not loaded: (\S+)")

_IMPORTS = (
    "numpy",
    "scipy.spatial",
    "shapely",
    "pyproj",
    "pyarrow.parquet",
    "matplotlib.figure",
    "lz4.frame",
    "zstandard",
    "pycrate_asn1dir.ITS_CAM_2",
    "safetensors",
    "rosbags.typesys",
    "mcap.reader",
    "sumolib",
    "libsumo",
    "torch",
    "advpipe.pipeline.core.open3d_library",
)


def missing_library_line(error: ImportError | OSError) -> str | None:
    """One line that names the missing library and how to install it; None for an error with another cause.

    error: what an import raised. Some libraries wrap the loader's message in one of their own, so the
    whole text and the chain of causes are searched.
    """
    for cause in _causes(error):
        if isinstance(cause, ModuleNotFoundError) and cause.name:
            return _module_line(cause.name)
        if isinstance(cause, ImportError) or (isinstance(cause, OSError) and cause.errno is None):
            line = loader_line(str(cause))
            if line is not None:
                return line
    return None


def loader_line(text: str) -> str | None:
    """The same line for a message of the system's loader, such as at a program's start; None for another."""
    if found := _ABSENT.search(text) or _ABSENT_ON_MACOS.search(text):
        return _absent_line(Path(found[1]).name)
    if found := _DAMAGED.search(text):
        return f"the shared library {found[1]} cannot be loaded ({found[2].strip()}); {_reinstall(found[1])}"
    if found := _OLD_SYSTEM.search(text):
        return (
            f"{Path(found[2]).name} needs {found[1].replace('_', ' ')}, which this operating system lacks; "
            "use a newer release"
        )
    return None


def _absent_line(soname: str) -> str:
    if sys.platform == "darwin":
        formula = soname.split("-")[0].split(".")[0]
        return f"the system library {soname} is missing; install it: brew install {formula}"
    package = DEBIAN_PACKAGES.get(soname)
    if package is None:
        return (
            f"the system library {soname} is missing; on Debian or Ubuntu, `apt-file search {soname}` names "
            f"its package; on Fedora, `dnf provides '*/{soname}'`"
        )
    return (
        f"the system library {soname} is missing; on Debian or Ubuntu: apt-get install {package} "
        "(docs/install.md names the packages of other systems)"
    )


def _reinstall(path: str) -> str:
    package = DEBIAN_PACKAGES.get(Path(path).name)
    parts = Path(path).parts
    if "site-packages" in parts:
        top = parts[parts.index("site-packages") + 1].removesuffix(".libs")
        return f"reinstall its package: pip install --force-reinstall {PIP_PACKAGES.get(top, top)}"
    if package is not None:
        return f"reinstall its package: apt-get install --reinstall {package}"
    return "reinstall its package"


def _module_line(module: str) -> str | None:
    top = module.partition(".")[0]
    if top == "advpipe":
        return None  # a defect of advpipe, not of the installation
    package = PIP_PACKAGES.get(top, top)
    ours = f"'advpipe[{EXTRAS[top]}]'" if top in EXTRAS else "advpipe"
    return f"the Python package {package} is missing (no module {module}); install it: pip install {ours}"


def _causes(error: BaseException) -> Iterator[BaseException]:
    seen: set[int] = set()
    cause: BaseException | None = error
    while cause is not None and id(cause) not in seen:
        seen.add(id(cause))
        yield cause
        cause = cause.__cause__ or cause.__context__


def problem_of_this_installation() -> str | None:
    """One line on the first library that does not load, or a SUMO that does not start; None if all work."""
    try:
        for module in _IMPORTS:
            importlib.import_module(module)
        import sumo

        program = Path(sumo.SUMO_HOME) / "bin" / "netconvert"
        done = subprocess.run([program, "--version"], capture_output=True, text=True)
    except (ImportError, OSError) as error:
        return missing_library_line(error) or f"{type(error).__name__}: {error}"
    return None if done.returncode == 0 else loader_line(done.stderr) or f"{program} does not start"


if __name__ == "__main__":
    problem = problem_of_this_installation()
    if problem is not None:
        sys.exit(f"advpipe: {problem}")
