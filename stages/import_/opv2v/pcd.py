"""Clouds of OPV2V: PCD files whose colour's red channel is the intensity, in left-handed coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud
from advpipe.stages.import_.pcd_file import read_pcd

_STRONGEST = 255


def read_opv2v_cloud(file: Path) -> Cloud:
    """The cloud (N,), in right-handed coordinates; intensities are 0 to 1.

    Coordinates change the sign of y only; a field `intensity` is taken as it is. Raises AdvpipeError for a
    file that is truncated or in another form.
    """
    try:
        fields = read_pcd(file)
    except OSError as error:
        raise AdvpipeError(f"{file}: cannot be read: {error.strerror or error}") from None
    except AdvpipeError as error:
        raise AdvpipeError(f"{file}: not a PCD file as OPV2V has them: {error}") from None
    if not set("xyz") <= fields.keys():
        raise AdvpipeError(f"{file}: not a PCD file as OPV2V has them: its fields are {' '.join(fields)}")
    cloud = np.zeros(len(fields["x"]), POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = fields["x"], -fields["y"].astype(np.float32), fields["z"]
    if "intensity" in fields:
        cloud["intensity"] = fields["intensity"]
    elif "rgb" in fields:
        packed = np.ascontiguousarray(fields["rgb"])
        colour = packed.view(np.uint32) if packed.dtype == np.float32 else packed.astype(np.uint32)
        cloud["intensity"] = ((colour >> 16) & 0xFF).astype(np.float32) / np.float32(_STRONGEST)
    return cloud
