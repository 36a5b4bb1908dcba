"""Open3D finds libusb, from the system or from libusb-package, and loads no more than it needs."""

from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.mark.oracle
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it is not loaded by its soname")
def test_libusb_can_be_loaded_by_its_soname() -> None:
    """As the loader does for Open3D 0.20, whose compiled module names it."""
    pytest.importorskip("libusb_package")
    code = (
        "import ctypes, advpipe.pipeline.core.open3d_library\n"
        "ctypes.CDLL('libusb-1.0.so.0').libusb_get_version"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere all of Open3D is loaded")
def test_only_the_compiled_part_is_loaded_until_open3d_is_imported() -> None:
    code = (
        "import sys\n"
        "from advpipe.pipeline.core.open3d_library import o3d\n"
        "assert not {'open3d', 'sklearn', 'pandas', 'dash', 'IPython'} & sys.modules.keys()\n"
        "import open3d\n"
        "assert open3d.core.Tensor is o3d.core.Tensor\n"
        "assert open3d.visualization.draw_plotly and open3d.ml.datasets"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
