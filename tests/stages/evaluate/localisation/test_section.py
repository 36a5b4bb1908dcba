"""From bags to a section of the report."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from section_rows import rows_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.localisation.monitor import nis_threshold
from advpipe.stages.evaluate.families import added_sections
from advpipe.stages.evaluate.localisation.section import localisation_sections
from advpipe.stages.evaluate.localisation.track import attacked_fixes_ns, read_track
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.report.section import ReportSection

FAR = {
    "type": "gnss-relocate",
    "parameters": {"least_m": 100, "most_m": 100},
    "schedule": {"from_s": 8, "to_s": 15},
}
JAM = {"type": "gnss-jam", "schedule": {"from_s": 8}}
AWARE = {"type": "gnss-drift-aware", "parameters": {"rate_mps": 3}, "schedule": {"from_s": 4}}


@pytest.fixture
def blank_pictures(monkeypatch):
    """For tests of figures: drawing takes most of the time."""
    monkeypatch.setattr(
        "advpipe.stages.evaluate.localisation.section.draw_localisation", lambda *_: Figure((1, 1))
    )


def test_a_track_is_what_the_bag_holds(clean):
    reader = BagReader(clean)
    track = read_track(reader, "ego")
    assert len(track.times_ns) == 200
    assert np.isfinite(track.nis).tolist() == [index % 2 == 0 for index in range(200)]
    recorded = [message.pose.pose.position for _, message in reader.messages("/ego/odometry")]
    assert np.array_equal(track.estimate_m, [[one.x, one.y, one.z] for one in recorded])
    errors = np.linalg.norm((track.fix_m - track.true_m)[::2], axis=1)
    assert 0 < np.median(errors) < 6


def test_which_fixes_were_attacked(clean, attacked):
    times = attacked_fixes_ns(BagReader(clean), BagReader(attacked("far", **FAR)), "ego")
    start_ns = BagReader(clean).log_times_ns("/ego/gnss/fix")[0]
    assert ((times - start_ns) / 1e9).tolist() == pytest.approx(np.arange(8, 15, 0.2).tolist())
    assert not len(attacked_fixes_ns(BagReader(clean), BagReader(clean), "ego"))


def test_records_tables_and_pictures(clean, attacked):
    bags = [attacked("far", **FAR), attacked("jam", **JAM), attacked("aware", **AWARE)]
    (section,) = localisation_sections(clean, bags, 0)
    far, jam, aware = rows_of(section)
    assert [one["bag"] for one in rows_of(section)] == ["far", "jam", "aware"]
    assert (far["fixes"], far["attacked"], far["lost"]) == (100, 35, 0)
    assert far["delay_s"] == 0  # 100 m are seen at once
    assert far["detection_rate"] > 0.5
    assert far["clean_mean_m"] < 5 < 50 < far["adv_max_m"]
    assert far["ate_m"] > 10 * far["ate_clean_m"]
    assert (jam["attacked"], jam["lost"]) == (60, 60)
    assert np.isnan(jam["detection_rate"])
    assert aware["detection_rate"] == 0
    assert aware["stealth_rate"] == 1
    assert np.isnan(aware["delay_s"])
    assert aware["adv_lateral_max_m"] > aware["clean_lateral_max_m"] + 1
    for table in section.tables:
        assert all(len(line) == len(table.heads) for line in table.lines)
        assert len([line for line in table.lines if line[0]]) == 3
    assert [one.file_name for one in section.pictures] == [
        f"{name}-ego-localisation.png" for name in ("far", "jam", "aware")
    ]


def test_pictures_show_the_attack(clean, attacked, tmp_path: Path):
    """The shade of the attacked span, and the same bytes again."""
    bags = [attacked("far", **FAR)]
    (picture,), (again,) = (localisation_sections(clean, bags, 0)[0].pictures for _ in range(2))
    assert picture.png == again.png
    (tmp_path / "p.png").write_bytes(picture.png)
    pixels = np.asarray(Image.open(tmp_path / "p.png").convert("RGB")).reshape(-1, 3)
    shade = (pixels == (0xFB, 0xE3, 0xE4)).all(axis=1).sum()
    assert shade > 0.02 * len(pixels)


def test_no_section_without_an_attack_on_gps(clean):
    assert localisation_sections(clean, [clean], 0) == ()
    assert localisation_sections(clean, [], 0) == ()


def test_refuses_a_bag_of_some_frames(clean, attacked, tmp_path: Path):
    reader = BagReader(attacked("far", **FAR))
    last_ns = int(reader.log_times_ns("/ego/odometry")[120])
    with BagWriter(tmp_path / "cut", provenance={}) as bag:
        for raw in reader.raw_messages(last_ns=last_ns):
            bag.copy(raw)
    with pytest.raises(AdvpipeError, match="holds estimates of ego at other times than"):
        localisation_sections(clean, [tmp_path / "cut"], 0)


def meaning_of(section: ReportSection, name: str) -> str:
    return next(formula.meaning for formula in section.formulas if formula.name == name)


def steps(clean: Path, first: int, end: int) -> Window:
    begin_ns = int(BagReader(clean).log_times_ns("/ego/odometry")[0])
    return Window(begin_ns + first * 10**8, begin_ns + end * 10**8)


@pytest.mark.usefixtures("blank_pictures")
def test_a_window_counts_what_the_whole_drives_tracks_hold_in_it(clean, attacked):
    """Steps 90 to 119, by hand: fixes at every second step, all false there, from an attack since step 80."""
    bag = attacked("far", **FAR)
    (section,) = localisation_sections(clean, [bag], window=steps(clean, 90, 120))
    (row,) = rows_of(section)
    before, after = read_track(BagReader(clean), "ego"), read_track(BagReader(bag), "ego")
    off_m, clean_m = (np.linalg.norm(each.error_m[90:120, :2], axis=1) for each in (after, before))
    alarm = after.nis[90:120:2] > nis_threshold()
    assert (row["fixes"], row["attacked"], row["lost"], row["span_s"]) == (15, 15, 0, 2.8)
    assert row["adv_mean_m"] == off_m[:29].mean()  # from the first attacked fix to the last one
    assert row["adv_max_m"] == off_m[:29].max()
    assert row["clean_mean_m"] == clean_m[:29].mean()
    assert row["success_rate"] == (off_m[:29] > 5).mean()
    assert row["ate_m"] == np.sqrt((after.error_m[90:120] ** 2).sum(axis=1).mean())
    assert row["detection_rate"] == alarm.mean()
    assert row["false_alarm_rate"] == (before.nis[90:120:2] > nis_threshold()).mean()
    caught = np.flatnonzero(alarm)
    assert row["delay_s"] == pytest.approx(0.2 * caught[0]) if len(caught) else np.isnan(row["delay_s"])
    assert section.tables[0].heads[-1] == "ATE m"
    assert "over the window" in meaning_of(section, "ate")


@pytest.mark.usefixtures("blank_pictures")
def test_a_window_of_everything_changes_no_figure(clean, attacked):
    bag = attacked("far", **FAR)
    (whole,), (same,) = (
        localisation_sections(clean, [bag], window=w) for w in (WHOLE_DRIVE, steps(clean, 0, 200))
    )
    np.testing.assert_equal(rows_of(same), rows_of(whole))
    assert [table.lines for table in same.tables] == [table.lines for table in whole.tables]
    assert "over the whole drive" in meaning_of(whole, "ate")


@pytest.mark.usefixtures("blank_pictures")
def test_before_the_attack_begins_nothing_is_off(clean, attacked, tmp_path):
    """The victim that the provenance names is told, with no attacked fix and the error of the clean drive."""
    bag = attacked("far", **FAR)
    assert localisation_sections(clean, [bag], window=steps(clean, 0, 79)) == ()  # it lists no attack
    with BagWriter(tmp_path / "told", provenance={"attacks": json.dumps([FAR])}) as writer:
        for raw in BagReader(bag).raw_messages():
            writer.copy(raw)
    (section,) = localisation_sections(clean, [tmp_path / "told"], window=steps(clean, 0, 79))
    (row,) = rows_of(section)
    assert (row["attacked"], row["span_s"]) == (0, 0)
    assert row["ate_m"] == row["ate_clean_m"] > 0
    assert all(np.isnan(row[name]) for name in ("adv_mean_m", "detection_rate", "echo_rate", "success_rate"))
    (after,) = rows_of(localisation_sections(clean, [bag], window=steps(clean, 160, 190))[0])
    assert after["attacked"] == 0  # it is over
    assert after["ate_m"] != after["ate_clean_m"]


@pytest.mark.usefixtures("blank_pictures")
def test_a_window_of_one_step_or_none(clean, attacked):
    bag = attacked("far", **FAR)
    (one,) = rows_of(localisation_sections(clean, [bag], window=steps(clean, 90, 91))[0])
    assert (one["fixes"], one["attacked"]) == (1, 1)
    assert localisation_sections(clean, [bag], window=steps(clean, 300, 310)) == ()


@pytest.mark.usefixtures("blank_pictures")
def test_what_comes_after_the_window_is_not_read(clean, attacked, monkeypatch):
    """A window that ends with the first half decodes half the messages, and some that are latched."""
    bag, decoded = attacked("far", **FAR), []
    decode = BagReader.decode_as_it_is
    monkeypatch.setattr(
        BagReader, "decode_as_it_is", lambda self, raw: decoded.append(raw.log_time_ns) or decode(self, raw)
    )
    counts = []
    for window in (WHOLE_DRIVE, steps(clean, 80, 100)):
        decoded.clear()
        localisation_sections(clean, [bag], window=window)
        counts.append(len(decoded))
    assert max(decoded) < steps(clean, 80, 100).end_ns
    assert counts[1] == pytest.approx(0.5 * counts[0], rel=0.02)


@pytest.mark.usefixtures("blank_pictures")
def test_frames_of_a_bag_without_clouds_are_refused(clean, attacked):
    with pytest.raises(AdvpipeError, match="holds no LiDAR clouds, so the frames 0:4:1 select no time span"):
        added_sections(clean, [attacked("far", **FAR)], Options(frames=FrameSlice.parse("0:4")))
    (whole,) = added_sections(clean, [attacked("far", **FAR)], Options())
    assert whole.notes == ()
