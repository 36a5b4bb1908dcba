"""What tests with the development kits of nuScenes and Argoverse 2 share."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest


def _compiled(*given: Any, **_: Any) -> Any:
    """numba's decorator without its compiler: the function in Python."""
    return given[0] if given and callable(given[0]) else lambda function: function


def _module(name: str, **attributes: Any) -> ModuleType:
    module = ModuleType(name)
    vars(module).update(attributes, __path__=[])
    return module


STAND_INS: dict[str, Callable[[], ModuleType]] = {
    "cv2": lambda: _module("cv2", LINE_AA=16),
    "cv2.typing": lambda: _module("cv2.typing", MatLike=Any),
    "numba": lambda: _module("numba", njit=_compiled, prange=range),
}


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets the kits be imported without OpenCV, which draws their pictures, and numba, 340 MB that readers of
    poses, points and boxes do without."""
    for name, make in STAND_INS.items():
        monkeypatch.setitem(sys.modules, name, make())
