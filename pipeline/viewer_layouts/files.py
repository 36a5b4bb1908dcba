"""The layouts of viewers as files beside a bag."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.viewer_layouts.foxglove import foxglove_layout
from advpipe.pipeline.viewer_layouts.rviz import rviz_config
from advpipe.pipeline.viewer_layouts.scene import viewer_scene

FOXGLOVE, RVIZ = "foxglove.json", "scene.rviz"
NAMES = (FOXGLOVE, RVIZ)


def layout_texts(bag: Path) -> Mapping[str, str]:
    """The texts of the layouts for a bag by the names of their files; they depend on its topics alone."""
    scene = viewer_scene(BagReader(bag, debug=True))
    return {FOXGLOVE: foxglove_layout(scene), RVIZ: rviz_config(scene)}


def write_layouts(bag: Path) -> None:
    """Write the layouts into the folder of a whole bag."""
    for name, text in layout_texts(bag).items():
        (bag / name).write_bytes(text.encode())
