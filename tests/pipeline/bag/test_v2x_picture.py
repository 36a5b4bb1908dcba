"""Statistics in a bag, and their picture."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.v2x_picture import draw_bag
from advpipe.pipeline.bag.v2x_statistics import read_statistics, statistics_message
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cli import app
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.build import string
from advpipe.pipeline.messages.topics import V2X_STATISTICS
from advpipe.pipeline.v2x.statistics import Tally

NOTHING = Tally().statistics()


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    with BagWriter(tmp_path / "bag", provenance={"scenario_name": "town"}) as writer:
        writer.write_cdr(*statistics_message(5, NOTHING))
    return tmp_path / "bag"


def test_statistics_come_back(bag: Path) -> None:
    assert read_statistics(BagReader(bag)) == NOTHING


def test_from_the_command_line(bag: Path, tmp_path: Path) -> None:
    picture = tmp_path / "v2x.png"
    done = CliRunner().invoke(app, ["plot", str(bag), "-o", str(picture)])
    assert done.exit_code == 0
    assert "v2x.png" in done.output
    drawn = picture.read_bytes()
    assert drawn.startswith(b"\x89PNG")
    with pytest.raises(AdvpipeError, match="already exists"):
        draw_bag(bag, picture)
    draw_bag(bag, picture, overwrite=True)
    assert picture.read_bytes() == drawn
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag", "v2x.png"]


@pytest.mark.parametrize(("suffix", "start"), [("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_other_formats(bag: Path, tmp_path: Path, suffix: str, start: bytes) -> None:
    draw_bag(bag, tmp_path / f"v2x.{suffix}")
    assert (tmp_path / f"v2x.{suffix}").read_bytes().startswith(start)


def test_what_cannot_be_drawn(bag: Path, tmp_path: Path, record: Callable[..., Path]) -> None:
    with pytest.raises(AdvpipeError, match=r"v2x\.jpeg2 is not a picture; use one of the extensions \.png"):
        draw_bag(bag, tmp_path / "v2x.jpeg2")
    plain = record(tmp_path / "plain", frames=1)
    assert read_statistics(BagReader(plain)) is None
    with pytest.raises(AdvpipeError, match="plain has no V2X statistics"):
        draw_bag(plain, tmp_path / "v2x.png")
    with BagWriter(tmp_path / "odd", provenance={}) as writer:
        writer.write(V2X_STATISTICS, string('{"pairs": 1}'), 5)
    with pytest.raises(
        AdvpipeError, match="odd: /v2x/statistics does not hold V2X statistics of this version"
    ):
        draw_bag(tmp_path / "odd", tmp_path / "v2x.png")
    with pytest.raises(OSError, match="nowhere"):
        draw_bag(bag, tmp_path / "nowhere" / "v2x.png")
    assert not list(tmp_path.glob("*v2x*"))
