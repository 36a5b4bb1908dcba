"""A second device on a machine without one: tensors that say they are on a GPU.

Their numbers are computed on the CPU, so that results can be compared; but as with CUDA, nothing works on
tensors of both devices at once, and NumPy takes none of a far one. Tensors made without a device are noted:
they are on the CPU.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_leaves, tree_map

FAR = torch.device("cuda", 0)

FACTORIES = {
    *(torch.arange, torch.as_tensor, torch.empty, torch.eye, torch.full, torch.linspace, torch.logspace),
    *(torch.ones, torch.rand, torch.randint, torch.randn, torch.randperm, torch.tensor, torch.zeros),
}


class FarTensor(Tensor):
    """What PyTorch's core sees is a tensor on `meta`, for which it needs no driver; Python sees `FAR`."""

    near: Tensor
    device = FAR  # type: ignore[assignment]
    __torch_function__ = torch._C._disabled_torch_function_impl  # type: ignore[assignment]

    @staticmethod
    def __new__(cls, near: Tensor) -> FarTensor:
        made: FarTensor = Tensor._make_wrapper_subclass(  # type: ignore[attr-defined]
            cls, near.shape, near.stride(), near.storage_offset(), dtype=near.dtype, device="meta"
        )
        made.near = near
        return made

    def __repr__(self) -> str:  # type: ignore[override]
        return f"FarTensor({self.near})"

    @classmethod
    def __torch_dispatch__(cls, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        for leaf in tree_leaves((args, kwargs)):
            if isinstance(leaf, Tensor) and not isinstance(leaf, FarTensor) and leaf.dim():
                raise RuntimeError(f"{func}: expected all tensors to be on the same device")
        far = {id(leaf.near): leaf for leaf in tree_leaves((args, kwargs)) if isinstance(leaf, FarTensor)}
        near = {key: _near(value) for key, value in kwargs.items() if key != "device"}
        result = func(*tree_map(_near, args), **near)
        # What is changed in place is the same tensor afterwards.
        return tree_map(
            lambda out: (
                (far[id(out)] if id(out) in far else FarTensor(out)) if isinstance(out, Tensor) else out
            ),
            result,
        )


def _near(value: Any) -> Any:
    return value.near if isinstance(value, FarTensor) else value


class _ToFar(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, tensor: Tensor) -> Tensor:
        return FarTensor(tensor.detach().clone())

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> Any:
        return _near(grads[0])


class _ToNear(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, tensor: Tensor) -> Tensor:
        return _near(tensor).clone()  # type: ignore[no-any-return]

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> Any:
        return FarTensor(grads[0])


class FarDevice(TorchFunctionMode):
    """While it lasts, `FAR` exists.

    homeless: the factories that were called without a device.
    """

    def __init__(self) -> None:
        super().__init__()
        self.homeless: list[str] = []

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = dict(kwargs or {})
        if func in FACTORIES:
            device = kwargs.pop("device", None)
            if device is None:
                self.homeless.append(func.__name__)
            made = func(*args, **kwargs)
            return FarTensor(made) if device == FAR else made
        if func in (Tensor.to, Tensor.cpu):
            return self._moved(func, args, kwargs)
        if func is Tensor.new_tensor and isinstance(args[0], FarTensor):
            return FarTensor(args[0].near.new_tensor(*args[1:], **kwargs))
        if func is Tensor.numpy and isinstance(args[0], FarTensor):
            raise TypeError("can't convert a far tensor to numpy")
        return func(*args, **kwargs)

    def _moved(self, func: Any, args: Any, kwargs: Any) -> Any:
        tensor, *rest = args
        devices = [value for value in (*rest, *kwargs.values()) if isinstance(value, torch.device)]
        rest = [value for value in rest if not isinstance(value, torch.device) and value is not None]
        kwargs = {key: value for key, value in kwargs.items() if key != "device"}
        target = torch.device("cpu") if func is Tensor.cpu else next(iter(devices), tensor.device)
        if tensor.device != target:
            tensor = (_ToFar if target == FAR else _ToNear).apply(tensor)
        return Tensor.to(tensor, *rest, **kwargs) if rest or kwargs else tensor
