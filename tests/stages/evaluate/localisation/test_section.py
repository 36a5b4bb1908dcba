"""From bags to a section of the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from advpipe.pipeline.bag.frame_slice import FrameSlice
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.evaluate.localisation.section import sections
from advpipe.stages.evaluate.localisation.track import attacked_fixes_ns, read_track
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.run import added_sections

FAR = {
    "type": "gnss-relocate",
    "parameters": {"least_m": 100, "most_m": 100},
    "schedule": {"from_s": 8, "to_s": 15},
}
JAM = {"type": "gnss-jam", "schedule": {"from_s": 8}}
AWARE = {"type": "gnss-drift-aware", "parameters": {"rate_mps": 3}, "schedule": {"from_s": 4}}


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
    (section,) = sections(clean, bags, 0)
    far, jam, aware = section.records
    assert [one["bag"] for one in section.records] == ["far", "jam", "aware"]
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
        assert len(table.lines) == 3
    assert [one.file_name for one in section.pictures] == [
        f"{name}-ego-localisation.png" for name in ("far", "jam", "aware")
    ]


def test_pictures_show_the_attack(clean, attacked, tmp_path: Path):
    """The shade of the attacked span, and the same bytes again."""
    bags = [attacked("far", **FAR)]
    (picture,), (again,) = (sections(clean, bags, 0)[0].pictures for _ in range(2))
    assert picture.png == again.png
    (tmp_path / "p.png").write_bytes(picture.png)
    pixels = np.asarray(Image.open(tmp_path / "p.png").convert("RGB")).reshape(-1, 3)
    shade = (pixels == (0xFB, 0xE3, 0xE4)).all(axis=1).sum()
    assert shade > 0.02 * len(pixels)


def test_no_section_without_an_attack_on_gps(clean):
    assert sections(clean, [clean], 0) == ()
    assert sections(clean, [], 0) == ()


def test_refuses_a_bag_of_some_frames(clean, attacked, tmp_path: Path):
    reader = BagReader(attacked("far", **FAR))
    last_ns = int(reader.log_times_ns("/ego/odometry")[120])
    with BagWriter(tmp_path / "cut", provenance={}) as bag:
        for raw in reader.raw_messages(last_ns=last_ns):
            bag.copy(raw)
    with pytest.raises(AdvpipeError, match="holds other estimates of ego"):
        sections(clean, [tmp_path / "cut"], 0)


def test_a_report_of_some_frames_says_that_this_part_is_of_the_whole_drive(clean, attacked, tmp_path):
    """The track's filter runs from the beginning; the same figures, and a note."""
    bag = attacked("far", **FAR)
    some, whole = (families_sections(clean, [bag], FrameSlice.parse(frames)) for frames in ("0:4", "::"))
    assert [one.records for one in some] == [one.records for one in whole]
    assert all(one.notes[-1].startswith("This part is of the whole drive") for one in some)
    assert not any("whole drive" in note for one in whole for note in one.notes)
    assert [one.key for one in some] == ["localisation"]


def families_sections(clean, bags, frames):
    return added_sections(clean, bags, Options(frames=frames))
