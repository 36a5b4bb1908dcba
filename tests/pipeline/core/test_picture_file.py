"""Names of picture files, and that equal figures are equal files."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.core.picture_file import FORMATS, picture_path, refuse_picture, save_picture


@pytest.mark.parametrize(
    ("out", "form", "expected"),
    [
        (None, None, "frame.png"),
        (None, "SVG", "frame.svg"),
        ("a.pdf", None, "a.pdf"),
        ("a.PDF", "pdf", "a.PDF"),
        ("a", "svg", "a.svg"),
    ],
)
def test_the_file_follows_from_name_and_format(out: str | None, form: str | None, expected: str) -> None:
    assert picture_path(Path(out) if out else None, form, "frame") == Path(expected)


def test_names_and_formats_that_contradict_each_other() -> None:
    with pytest.raises(UsageError, match=r"a\.png has another extension than the format svg"):
        picture_path(Path("a.png"), "svg", "frame")
    with pytest.raises(UsageError, match="unknown format of pictures 'gif'; known: png, pdf, svg"):
        picture_path(None, "gif", "frame")


def test_a_file_that_exists_is_kept(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    with pytest.raises(AdvpipeError, match="already exists"):
        refuse_picture(tmp_path / "a.png", overwrite=False)
    refuse_picture(tmp_path / "a.png", overwrite=True)
    with pytest.raises(UsageError, match=r"a\.bmp is not a picture"):
        refuse_picture(tmp_path / "a.bmp", overwrite=True)


@pytest.mark.parametrize("suffix", FORMATS)
def test_equal_figures_are_equal_files(tmp_path: Path, suffix: str) -> None:
    def draw(name: str) -> bytes:
        figure = Figure(figsize=(2, 2))
        axes = figure.subplots()
        axes.plot([0, 1], [0, 2], label="line")
        axes.scatter([0, 1], [1, 2], rasterized=True)
        save_picture(figure, tmp_path / f"{name}{suffix}")
        return (tmp_path / f"{name}{suffix}").read_bytes()

    assert draw("a") == draw("b")
    assert len(list(tmp_path.iterdir())) == 2
