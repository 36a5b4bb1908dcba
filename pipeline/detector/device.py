"""The processor that a detector computes on, by the name that --device takes."""

from __future__ import annotations

import os
import re
import warnings
from typing import TYPE_CHECKING

from advpipe.pipeline.core.errors import UsageError

if TYPE_CHECKING:
    import torch

CPU = "cpu"

FRAMES_AT_ONCE = {"cpu": 1, "cuda": 8}
"""How many frames an attack on clouds works through at once, as one batch, by the kind of device."""

_KNOWN = re.compile(r"cpu|cuda(?::([0-9]{1,4}))?")


def open_device(name: str) -> torch.device:
    """The device `cpu`, `cuda` (the first GPU) or `cuda:N`, ready to compute.

    On CUDA, PyTorch is told, for this process, to add in a fixed order wherever it can and to keep to single
    precision (no TF32), so that one machine gives the same result each time, and nearly the CPU's.

    Raises AdvpipeError for any other name, and for a GPU that PyTorch does not find.
    """
    known = _KNOWN.fullmatch(name)
    if known is None:
        raise UsageError(f"unknown device {name!r}; known: cpu, cuda, cuda:N (N counts GPUs from 0)")
    import torch

    if name == CPU:
        return torch.device(CPU)
    count, index = torch.cuda.device_count() if torch.cuda.is_available() else 0, int(known[1] or 0)
    if not count:
        build = torch.__version__
        raise UsageError(
            f"device {name}: PyTorch {build} finds no CUDA GPU; use --device cpu, or install PyTorch's CUDA "
            "build and NVIDIA's driver"
        )
    if index >= count:
        raise UsageError(f"device {name}: the last of {count} CUDA GPUs is cuda:{count - 1}")
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    torch.use_deterministic_algorithms(True, warn_only=True)
    # The product that it warns of has factors of 0 and 1 only, exact in any order.
    warnings.filterwarnings("ignore", "scatter_reduce_cuda_prod")
    torch.backends.cudnn.allow_tf32 = False
    torch.backends.cuda.matmul.allow_tf32 = False
    return torch.device("cuda", index)


def frames_at_once(name: str) -> int:
    """Of how many frames a device gets a batch; it decides their last bits."""
    return FRAMES_AT_ONCE[_kind(name)]


def device_record(name: str) -> dict[str, str]:
    """What records of results say of the device, since it decides their last bits: nothing of the CPU.

    Which of several GPUs it was is not told.
    """
    return {} if name == CPU else {"device": _kind(name)}


def _kind(name: str) -> str:
    return name.partition(":")[0]
