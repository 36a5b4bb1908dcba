"""The data set that comes with advpipe: small, of an unseen map, and the same when `make sample` makes it."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest

import advpipe
from advpipe.pipeline.bag.carried import CLOUD_TYPE
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.cli import app
from advpipe.pipeline.core.errors import OutputExistsError
from advpipe.pipeline.core.versions import installed
from advpipe.pipeline.dataset.sample import copy_sample, shipped_report, shipped_sample
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.training_maps import is_training_map, map_of
from advpipe.pipeline.scenario import dump_scenario, load_scenario
from advpipe.stages.evaluate.report.html import STYLE
from advpipe.stages.simulate.run import simulate
from advpipe.stages.verify.run import verify

CLEAN = shipped_sample() / "clean"


def test_it_is_small() -> None:
    files = [path for path in shipped_sample().rglob("*") if path.is_file() and path.suffix != ".pyc"]
    assert {path.name for path in files} == {
        "__init__.py",
        "scenario.yaml",
        "report.html",
        "clean_0.mcap",
        "metadata.yaml",
    }
    assert sum(path.stat().st_size for path in files) <= 3_000_000


def test_it_is_of_the_scenario_and_of_an_unseen_map() -> None:
    scenario = load_scenario("sample")
    assert (shipped_sample() / "scenario.yaml").read_text(encoding="utf-8") == dump_scenario(scenario)
    reader = BagReader(CLEAN)
    assert is_training_map(load_detector("small"), map_of(reader.provenance)) is False
    grid_m = scenario.sensors.lidars["lidar"].coordinate_grid_m
    frames = list(advpipe.open_bag(CLEAN).frames())
    assert len(frames) == 3
    for frame in frames:
        places = np.stack([frame.cloud[axis] for axis in "xyz"]) / grid_m
        assert (places == np.round(places)).all()
        assert set(frame.cloud["ring"]) <= set(range(32))


def test_nothing_is_wrong_with_it() -> None:
    assert verify(CLEAN).is_good


def test_a_copy_is_the_same_and_replaces_nothing_unasked(tmp_path: Path) -> None:
    clean = copy_sample(tmp_path / "copy")
    assert clean == tmp_path / "copy" / "clean"
    for name in ("clean/clean_0.mcap", "clean/metadata.yaml", "scenario.yaml"):
        assert (tmp_path / "copy" / name).read_bytes() == (shipped_sample() / name).read_bytes()
    with pytest.raises(OutputExistsError):
        copy_sample(tmp_path / "copy")
    (tmp_path / "copy" / "attack").mkdir()
    copy_sample(tmp_path / "copy", overwrite=True)
    assert (tmp_path / "copy" / "attack").is_dir()


def test_the_report_holds_its_pictures() -> None:
    page = shipped_report().read_text(encoding="utf-8")
    assert "detach-1-percent" in page
    assert "attach-300-points" in page
    assert page.count('<img src="data:image/svg+xml,') > 5
    assert "data:image/png" not in page


def test_the_report_is_a_page_of_today() -> None:
    """`make sample` brings it up to date."""
    assert STYLE.read_text(encoding="utf-8") in shipped_report().read_text(encoding="utf-8")


def test_the_drive_is_the_same_when_it_is_made_anew(tmp_path: Path) -> None:
    """The same bytes, but for what another processor rounds otherwise: some points, last digits of poses."""
    versions = json.loads(BagReader(CLEAN).provenance["versions"])
    if any(installed(package) != version for package, version in versions.items()):
        pytest.skip(f"the shipped bag was made with other versions: {versions}")
    simulate(load_scenario("sample"), tmp_path / "anew")
    for name in ("clean/metadata.yaml", "scenario.yaml"):
        assert (tmp_path / "anew" / name).read_text() == (shipped_sample() / name).read_text(), name
    made, shipped = BagReader(tmp_path / "anew" / "clean"), BagReader(CLEAN)
    assert made.provenance == shipped.provenance
    for ours, theirs in zip(made.raw_messages(), shipped.raw_messages(), strict=True):
        assert (ours.topic, ours.log_time_ns, len(ours.cdr)) == (
            theirs.topic,
            theirs.log_time_ns,
            len(theirs.cdr),
        )
        if ours.topic.type == CLOUD_TYPE:
            cloud, other = made.cloud(ours).cloud, shipped.cloud(theirs).cloud
            assert (cloud != other).mean() < 0.01
        elif bytes(ours.cdr) != bytes(theirs.cdr):
            assert_almost_equal(made.decode(ours), shipped.decode(theirs), ours.topic.name)


def assert_almost_equal(ours: object, theirs: object, place: str) -> None:
    """Of two messages or parts of them: numbers within rounding, everything else equal."""
    if is_dataclass(ours):
        for field in fields(ours):
            of_both = getattr(ours, field.name), getattr(theirs, field.name)
            assert_almost_equal(*of_both, f"{place}.{field.name}")
    elif isinstance(ours, float | np.ndarray):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9, err_msg=place)  # type: ignore[arg-type]
    elif isinstance(ours, list) and isinstance(theirs, list):
        for index, (our_item, their_item) in enumerate(zip(ours, theirs, strict=True)):
            assert_almost_equal(our_item, their_item, f"{place}[{index}]")
    else:
        assert ours == theirs, place


@pytest.mark.nightly
def test_the_report_tells_the_same_figures_when_it_is_made_anew(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        app(["run", "sample", "--out", str(tmp_path / "anew")])
    assert not ended.value.code
    page = shipped_report().read_text(encoding="utf-8")
    for row in json.loads((tmp_path / "anew/reports/small/report.json").read_text())["rows"]:
        assert f"{row['map_ratio_percent']:.2f}" in page
