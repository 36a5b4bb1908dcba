"""The pictures of a report, as PNG files and for the page itself."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from advpipe.pipeline.progress import track
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.birds_eye import draw_scene
from advpipe.stages.evaluate.report.ratios import draw_ratios
from advpipe.stages.evaluate.report.scene import load_scenes

SCENES_PER_BAG = 3


@dataclass(frozen=True)
class Picture:
    """One PNG of the report."""

    bag: str
    file_name: str
    caption: str
    png: bytes

    @property
    def data_uri(self) -> str:
        return "data:image/png;base64," + base64.b64encode(self.png).decode("ascii")


def draw_pictures(
    clean: Path, summaries: Sequence[Summary], folder: Path, lidar_topic: str | None = None
) -> list[Picture]:
    """Draw all pictures of a report into a new folder: the ratios, then the worst frames of each bag."""
    pictures = []
    if any(summary.comparison.bag for summary in summaries):
        figure = draw_ratios([summary.row for summary in summaries])
        pictures.append(Picture("", "map_ratio.png", "mAP ratio of each attack", to_png(figure)))
    for summary in track(summaries, "pictures", len(summaries)):
        for scene in load_scenes(clean, summary, SCENES_PER_BAG, lidar_topic):
            png = to_png(draw_scene(scene))
            pictures.append(Picture(summary.comparison.name, f"{scene.name}.png", scene.title, png))
    folder.mkdir()
    for picture in pictures:
        (folder / picture.file_name).write_bytes(picture.png)
    return pictures


def to_png(figure: Figure) -> bytes:
    """The figure as PNG, the same bytes for the same figure; no display is needed."""
    stream = io.BytesIO()
    with rc_context({"font.family": "DejaVu Sans"}):
        FigureCanvasAgg(figure)
        figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()
