"""Loads Open3D. From version 0.20 on its wheels need libusb, for depth cameras that advpipe never opens.

Where the system has no libusb, the library of the package libusb-package is loaded first, which the loader
then finds by its soname. This is done only on Linux: elsewhere Open3D loads libusb by a fixed path, or not
at all.

`o3d` is only the compiled part of Open3D where that can be loaded separately. The rest, plots and data sets
for machine learning, loads scikit-learn, pandas, dash and IPython, and takes 5 s of processor time, not 0.6.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

__all__ = ["o3d"]

LIBUSB = "libusb-1.0.so.0"


def _offer_libusb() -> None:
    with suppress(OSError):
        ctypes.CDLL(LIBUSB)
        return
    package = find_spec("libusb_package")
    if package is not None and package.origin is not None:
        with suppress(OSError):  # then Open3D itself reports that libusb is missing, if it needs it
            ctypes.CDLL(str(Path(package.origin).parent / "libusb-1.0.so"), mode=ctypes.RTLD_GLOBAL)


def _bindings_alone() -> Path | None:
    """The folder of Open3D if its compiled part can be loaded without its `__init__`, else None."""
    package = find_spec("open3d")
    if sys.platform != "linux" or "open3d" in sys.modules or package is None or package.origin is None:
        return None
    folder = Path(package.origin).parent
    has_cuda = (folder / "cuda").exists()
    return None if has_cuda or not any((folder / "cpu").glob("pybind*")) else folder


@contextmanager
def _without_its_init(folder: Path) -> Iterator[None]:
    """Make `open3d` an empty package within the block; a later import loads the full package."""
    os.environ["KMP_DUPLICATE_LIB_OK"], os.environ["TCM_ENABLE"] = "True", "1"  # as its `__init__` does
    bare = ModuleType("open3d")
    bare.__path__ = [str(folder)]
    sys.modules["open3d"] = bare
    try:
        yield
    finally:
        del sys.modules["open3d"]


if sys.platform == "linux":
    _offer_libusb()

if (_folder := _bindings_alone()) is None:
    import open3d as o3d
else:
    with _without_its_init(_folder):
        from open3d.cpu import pybind as o3d
