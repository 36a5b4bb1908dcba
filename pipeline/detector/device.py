"""The device that a detector computes on, by its name in --device."""

from __future__ import annotations

import os
import re
import warnings
from typing import TYPE_CHECKING

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.job_engine import runs_elsewhere
from advpipe.pipeline.core.option_names import option_name

if TYPE_CHECKING:
    import torch

CPU = "cpu"

FRAMES_AT_ONCE = {"cpu": 1, "cuda": 8}
"""How many frames an attack on clouds processes as one batch, by type of device."""

_KNOWN = re.compile(r"cpu|cuda(?::([0-9]{1,4}))?")


def open_device(name: str) -> torch.device:
    """The device `cpu`, `cuda` (the first GPU) or `cuda:N`, ready to compute.

    On CUDA, PyTorch is set, for this process, to deterministic algorithms where possible and to single
    precision (no TF32), so that one machine gives the same result each time, nearly equal to the CPU's.

    Raises AdvpipeError for any other name, and for a GPU that PyTorch does not find.
    """
    known = _KNOWN.fullmatch(name)
    if known is None:
        raise UsageError(f"unknown device {name!r}; known: cpu, cuda, cuda:N (N counts GPUs from 0)")
    import torch

    if name == CPU:
        return torch.device(CPU)
    count, index = torch.cuda.device_count() if torch.cuda.is_available() else 0, int(known[1] or 0)
    if not count and runs_elsewhere():
        return torch.device(CPU)  # the GPUs are the cluster's: here, detectors only say what they are
    if not count:
        build = torch.__version__
        raise UsageError(
            f"device {name}: PyTorch {build} finds no CUDA GPU; use {option_name('device', 'cpu')}, or "
            "install PyTorch's CUDA build and NVIDIA's driver"
        )
    if index >= count:
        raise UsageError(f"device {name}: the last of {count} CUDA GPUs is cuda:{count - 1}")
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    torch.use_deterministic_algorithms(True, warn_only=True)
    # It warns of a product whose factors are only 0 and 1, which is exact in any order.
    warnings.filterwarnings("ignore", "scatter_reduce_cuda_prod")
    torch.backends.cudnn.allow_tf32 = False
    torch.backends.cuda.matmul.allow_tf32 = False
    return torch.device("cuda", index)


def frames_at_once(name: str) -> int:
    """The number of frames in a batch on a device; it affects the last bits of results."""
    return FRAMES_AT_ONCE[_device_type(name)]


def device_record(name: str) -> dict[str, str]:
    """The device as recorded with results, since it affects their last bits; nothing for the CPU.

    The index of a GPU is not recorded.
    """
    return {} if name == CPU else {"device": _device_type(name)}


def _device_type(name: str) -> str:
    return name.partition(":")[0]
