"""V2X of a part of a drive: what lies in the window counts, and nothing after it is read."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from section_rows import rows_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window, window_of
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.labels.messages import are_false, read_labels
from advpipe.pipeline.misbehaviour.config import DetectorConfig
from advpipe.pipeline.misbehaviour.detector import judge_all
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.stages.evaluate.families import added_sections
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.v2x import receptions
from advpipe.stages.evaluate.v2x.collision import warnings
from advpipe.stages.evaluate.v2x.drive import EvaluatedDrive, read_drive
from advpipe.stages.evaluate.v2x.receptions import read_receptions
from advpipe.stages.evaluate.v2x.section import v2x_sections


def seconds(bag: Path, first_s: float, end_s: float) -> Window:
    begin_ns = int(BagReader(bag).log_times_ns("/ego/odometry")[0])
    return Window(begin_ns + round(first_s * 1e9), begin_ns + round(end_s * 1e9))


@pytest.fixture(scope="module")
def late(smoke: Path, offset: Path) -> tuple[Window, EvaluatedDrive]:
    window = seconds(smoke, 2.5, 3.3)
    return window, read_drive(offset, "offset", window=window)


def test_detection_is_of_the_messages_that_arrive_in_it(
    offset: Path, late: tuple[Window, EvaluatedDrive]
) -> None:
    """By hand: the whole drive's verdicts, one a message, cut to the window."""
    window, drive = late
    (ego,) = read_receptions(BagReader(offset))
    arrivals_ns = np.array([one.arrival_ns for one in ego.received])
    inside = (arrivals_ns >= window.begin_ns) & (arrivals_ns < window.end_ns)
    flagged = judge_all(ego.claims, ego.receivers, DetectorConfig()).flagged
    is_false = are_false(ego.numbers, read_labels(offset))
    assert 0 < inside.sum() < len(inside) / 2
    found = drive.detection
    assert (found.messages, found.false_messages) == (inside.sum(), (inside & is_false).sum())
    assert found.false_messages > 0
    assert found.ours.true_positives == (inside & is_false & flagged).sum()
    assert found.ours.false_positives == (inside & ~is_false & flagged).sum()
    whole = read_drive(offset, "offset").detection
    assert whole.false_messages > found.false_messages


def test_the_map_and_the_warning_are_of_the_maps_in_it(
    offset: Path, late: tuple[Window, EvaluatedDrive]
) -> None:
    window, drive = late
    whole = read_drive(offset, "offset")
    inside = window.holds(whole.errors["ego"].time_ns)
    assert inside.sum() == 8
    for name, values in vars(whole.errors["ego"]).items():
        np.testing.assert_array_equal(getattr(drive.errors["ego"], name), values[inside])
    cut = [moment for moment in whole.moments["ego"] if window.holds(moment.time_ns)]
    assert asdict(warnings(cut)) == asdict(warnings(drive.moments["ego"]))


def test_messages_of_both_bags_are_those_of_the_same_time(
    smoke: Path, offset: Path, late: tuple[Window, EvaluatedDrive]
) -> None:
    window, drive = late
    clean = read_drive(smoke, "clean", window=window)
    sent = {one.number: one.request_ns for step in V2xDrive(BagReader(smoke)).steps() for one in step.sent}
    for each in (clean, drive):
        assert each.received["ego"].near
        assert all(window.holds(sent[number]) for number in each.received["ego"].near)
    assert clean.received["ego"].near == drive.received["ego"].near
    assert clean.received["ego"].delivered(drive.honest("ego")) > 0.5


def test_channel_metrics_are_of_whole_drives_only(smoke: Path, offset: Path) -> None:
    """All else is the same in a window of everything, and the report says what is left out."""
    (whole,), (same,) = (
        v2x_sections(smoke, [offset], window=window) for window in (WHOLE_DRIVE, seconds(smoke, 0, 9))
    )
    radio = [name for name in rows_of(whole)[0] if name.startswith("radio_")]
    assert len(radio) == 6
    for before, after in zip(rows_of(whole), rows_of(same), strict=True):
        np.testing.assert_equal(after, {k: v for k, v in before.items() if k not in radio})
    assert [len(found.tables[3].lines) for found in (whole, same)] == [2, 0]
    assert whole.notes == ()
    assert "No metrics of the radio channel" in same.notes[-1]


def test_before_the_attack_begins_no_message_is_false(smoke: Path, offset: Path) -> None:
    """Lies begin after 2 s: until then both bags are one."""
    (found,) = v2x_sections(smoke, [offset], window=seconds(smoke, 0.5, 1.9))
    clean, attacked = rows_of(found)
    assert (attacked["false_messages"], attacked["attack"]) == (0, "cam-position-offset")
    names = [name for name in clean if name.startswith(("ldm_", "warning_", "honest_"))]
    assert len(names) > 10
    for name in (*names, "messages"):
        np.testing.assert_equal(attacked[name], clean[name])
    assert set(found.tables[0].lines[0][4:-1]) == {"–"}


def test_nothing_after_the_window_is_read(smoke: Path, offset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An eighth of the drive opens an eighth of what was received; so late messages cost nothing."""
    opened: list[bytes] = []

    def counted(payload: bytes) -> Cam:
        opened.append(payload)
        return decode_cam(payload)

    monkeypatch.setattr(receptions, "decode_cam", counted)
    read_drive(offset, "offset")
    whole = len(opened)
    opened.clear()
    read_drive(offset, "offset", window=seconds(smoke, 0.5, 1))
    assert 0 < len(opened) < 0.35 * whole


def test_frames_choose_the_window_and_the_report_says_so(smoke: Path, offset: Path) -> None:
    frames = FrameSlice.parse("25:33:4")  # 25 and 29: until 3.0 s, and all that lies between
    (found,) = added_sections(smoke, [offset], Options(frames=frames))
    (expected,) = v2x_sections(smoke, [offset], window=seconds(smoke, 2.5, 3.0))
    np.testing.assert_equal(rows_of(found), rows_of(expected))
    assert window_of(BagReader(smoke), frames) == seconds(smoke, 2.5, 3.0)
    assert "window of 0.5 s" in found.notes[-1]
