"""The figures of a finished report in a folder of their own, in the format that a paper takes."""

from __future__ import annotations

import shutil
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.partial import FolderKind, staged_folder
from advpipe.pipeline.core.progress import track

FORMATS = {"pdf": "svg", "svg": "svg", "png": "png"}
"""The formats, each with the one that it is made from, in which `evaluate` draws the figure."""

MOST_BYTES = 50_000_000
"""Of an SVG: those of `evaluate` have up to a few million."""


def export_figures(report: Path, file_format: str, out: Path, overwrite: bool = False) -> tuple[Path, ...]:
    """Write the figures of a report in one format to the folder `out`; the paths written, by name.

    In PDF and SVG the points of clouds are pixels, texts are outlines, and the rest is vectors.

    report: the folder that `evaluate` wrote, or its report.html. Raises UsageError for another folder or
    format, AdvpipeError for a report that does not hold the format, OutputExistsError for an existing `out`
    without `overwrite`.
    """
    if file_format not in FORMATS:
        raise UsageError(f"unknown format {file_format!r}; known: {', '.join(FORMATS)}")
    folder = report.parent if report.is_file() else report
    if not (folder / "report.json").is_file():
        inside = sorted(path.parent for path in folder.glob("reports/*/report.json"))
        known = f", such as {inside[0]}" if inside else ""
        raise UsageError(
            f"{report} is not a report: it has no report.json; name a folder that evaluate wrote{known}"
        )
    drawn_as = FORMATS[file_format]
    found = sorted(
        path
        for path in (folder / "figures").glob(f"*.{drawn_as}")
        if path.is_file() and not path.is_symlink()
    )
    if not found:
        raise AdvpipeError(f"{folder} holds no figures as {drawn_as.upper()}; evaluate again to draw them")
    names = tuple(f"{path.stem}.{file_format}" for path in found)
    with staged_folder(out, overwrite, FolderKind("folder of figures", names, ())) as partial:
        for path, name in zip(track(found, "figures", len(found)), names, strict=True):
            if file_format == drawn_as:
                shutil.copyfile(path, partial / name)
            else:
                (partial / name).write_bytes(_pdf(path))
    return tuple(out / name for name in names)


def _pdf(svg: Path) -> bytes:
    from advpipe.stages.evaluate.report.pictures import to_pdf
    from advpipe.stages.evaluate.report.vector_drawing import figure_of_svg

    if svg.stat().st_size > MOST_BYTES:
        raise AdvpipeError(f"{svg} has more than {MOST_BYTES:,} bytes: `evaluate` draws no such figure")
    try:
        figure = figure_of_svg(svg.read_bytes())
    except AdvpipeError as error:
        raise AdvpipeError(f"{svg} is {error}") from None
    try:
        return to_pdf(figure)
    except (ArithmeticError, TypeError, ValueError) as error:
        raise AdvpipeError(f"{svg} cannot be drawn: {error}") from None
