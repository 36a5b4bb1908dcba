"""Open3D. From 0.20 on its wheels need libusb, for depth cameras that advpipe never opens.

Where the system has no libusb, the one of the package libusb-package is loaded first: the loader then takes
its soname for found. On Linux alone: elsewhere Open3D looks for libusb by a fixed path, or not at all.
"""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

__all__ = ["o3d"]

LIBUSB = "libusb-1.0.so.0"


def _offer_libusb() -> None:
    with suppress(OSError):
        ctypes.CDLL(LIBUSB)
        return
    package = find_spec("libusb_package")
    if package is not None and package.origin is not None:
        with suppress(OSError):  # then Open3D says itself that it misses libusb, if it needs it
            ctypes.CDLL(str(Path(package.origin).parent / "libusb-1.0.so"), mode=ctypes.RTLD_GLOBAL)


if sys.platform == "linux":
    _offer_libusb()

import open3d as o3d  # noqa: E402
