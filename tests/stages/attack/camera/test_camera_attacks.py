"""Attacks on the cameras of a drive: what they change, what they label, what verify and evaluate say."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from camera_bags import FRONT, REAR, images, labels, same

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.messages.compressed_image import image_from_cdr, pixels_of
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.camera.base import CameraAttack, CameraTraits, whole_image
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.evaluate.coordinated.attack_timeline import read_attack_timelines
from advpipe.stages.evaluate.coordinated.section import coordinated_sections
from advpipe.stages.verify.run import verify

ALL = ("drop", "freeze", "delay", "blind", "patch")


class Mirror(CameraAttack):
    """Turns images around."""

    traits = CameraTraits()

    def __init__(self, *, limit: float = 1.0) -> None:
        self.limit = limit

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {"pixel_share": (0, self.limit)}

    def begin(self, rng: np.random.Generator, drive: Any) -> Any:
        return lambda image, context: whole_image(image.with_rgb(image.rgb()[:, ::-1].copy()))


def rest(bag: Path, *but: str) -> Iterator[tuple[str, int, bytes]]:
    reader = BagReader(bag)
    for raw in reader.raw_messages([name for name in reader.topics if name not in but]):
        yield raw.topic.name, raw.log_time_ns, raw.cdr


@pytest.mark.parametrize("name", ALL)
def test_all_else_is_copied(name: str, camera_drive: Path) -> None:
    """Depth, instances, boxes and the other camera too."""
    assert list(rest(camera_drive / name, FRONT)) == list(rest(camera_drive / "clean", FRONT))


def test_dropped_images_never_arrive(camera_drive: Path) -> None:
    clean, found = images(camera_drive / "clean"), images(camera_drive / "drop")
    assert len(clean) == 12
    assert all(map(same, found, [*clean[:4], *clean[9:]]))
    assert [(row["image"], row["action"]) for row in labels(camera_drive / "drop")] == [
        (number, "dropped") for number in range(4, 9)
    ]


def test_a_frozen_picture_has_the_stamps_of_those_that_it_hides(camera_drive: Path) -> None:
    clean = [image_from_cdr(raw.cdr) for raw in images(camera_drive / "clean")]
    found = [image_from_cdr(raw.cdr) for raw in images(camera_drive / "freeze")]
    assert [one.stamp_ns for one in found] == [one.stamp_ns for one in clean]
    shown = [3 if 4 <= number < 9 else number for number in range(12)]
    assert [one.file for one in found] == [clean[number].file for number in shown]
    assert {row["source"] for row in labels(camera_drive / "freeze")} == {3}


def test_delayed_images_keep_their_order(camera_drive: Path) -> None:
    """Images 4 to 8, 0.25 s late each; the attack ends before 0.9 s, when image 9 brings the rest."""
    clean, found = images(camera_drive / "clean"), images(camera_drive / "delay")
    start_ns = clean[0].log_time_ns
    assert [one.cdr for one in found] == [one.cdr for one in clean]
    late_s = [
        (after.log_time_ns - before.log_time_ns) / 1e9 for before, after in zip(clean, found, strict=True)
    ]
    assert late_s == pytest.approx([0] * 4 + [0.25, 0.25, 0.25, 0.2, 0.1] + [0] * 3)
    assert sorted(one.log_time_ns for one in found) == [one.log_time_ns for one in found]
    assert (found[8].log_time_ns - start_ns) / 1e9 == pytest.approx(0.9)
    assert [row["delay_ns"] / 1e9 for row in labels(camera_drive / "delay")] == pytest.approx(late_s[4:9])


def test_what_is_late_at_the_end_never_arrives(camera_drive: Path, tmp_path: Path) -> None:
    spec = AttackSpec(
        type="camera-delay", parameters={"delay_s": 0.3, "camera": "front"}, schedule=Schedule(from_s=0.5)
    )
    attack(camera_drive / "clean", tmp_path / "late", AttackRequest((spec,)))
    actions = [(row["image"], row["action"]) for row in labels(tmp_path / "late")]
    assert actions == [(n, "delayed") for n in range(5, 9)] + [(n, "dropped") for n in range(9, 12)]
    shutil.copytree(camera_drive / "clean", tmp_path / "clean")
    assert verify(tmp_path / "late").is_good


def test_a_light_saturates_where_it_stands_and_veils_the_rest(camera_drive: Path) -> None:
    """4 degrees left, 1 up: 228.5 tan(4 deg) = 16 pixels left, 4 up of the middle of 320 x 180."""
    clean, found = (images(camera_drive / name) for name in ("clean", "blind"))
    for number, (before, after) in enumerate(zip(clean, found, strict=True)):
        if not 4 <= number < 9:
            assert same(before, after)
            continue
        dark, bright = (pixels_of(image_from_cdr(raw.cdr).file).astype(float) for raw in (before, after))
        row, column = 89.5 - 4.0, 159.5 - 16.0
        assert bright[round(row) - 1 : round(row) + 2, round(column) - 1 : round(column) + 2].min() > 250
        near = bright[60:110, 105:180].mean() - dark[60:110, 105:180].mean()
        far = bright[:, 300:].mean() - dark[:, 300:].mean()
        assert near > far + 10


def test_the_light_is_strong_enough_for_noon(camera_drive: Path) -> None:
    """What the attack says of its default: over one per cent of every image is saturated."""
    for name, low, high in (("clean", 0.0, 0.002), ("blind", 0.01, 0.1)):
        for raw in images(camera_drive / name)[4:9]:
            saturated = (pixels_of(image_from_cdr(raw.cdr).file) >= 250).all(axis=2).mean()
            assert low <= saturated < high, name


def test_exposure_follows_the_light(camera_drive: Path) -> None:
    """What is far from the light grows darker from image to image, in spite of the stray light."""
    corner = [
        pixels_of(image_from_cdr(raw.cdr).file)[150:, 250:].mean()
        - pixels_of(image_from_cdr(plain.cdr).file)[150:, 250:].mean()
        for plain, raw in zip(images(camera_drive / "clean"), images(camera_drive / "blind"), strict=True)
    ]
    assert corner[8] < min(corner[4], 0)


def test_the_bags_verify(camera_drive: Path) -> None:
    found = verify(camera_drive)
    assert found.is_good, found.findings


def test_same_seed_same_bytes(camera_drive: Path, tmp_path: Path) -> None:
    spec = AttackSpec(type="camera-patch", parameters={"camera": "front", "pattern": "random"})
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        attack(camera_drive / "clean", tmp_path / name, AttackRequest((spec,), seed=seed))
    a, b, c = ([one.cdr for one in images(tmp_path / name)] for name in "abc")
    assert a == b != c
    assert labels(tmp_path / "a") == labels(tmp_path / "b")


def test_cameras_and_gps_are_attacked_at_the_same_moment(camera_drive: Path, tmp_path: Path) -> None:
    """A coordinated attack is on one time axis, in the bag and in the report."""
    schedule = Schedule(from_s=0.4, to_s=0.9)
    specs = (
        AttackSpec(type="gnss-bias", victim="ego", schedule=schedule),
        AttackSpec(type="camera-freeze", victim="ego", schedule=schedule, parameters={"camera": "front"}),
    )
    clean, bag = camera_drive / "clean", tmp_path / "both"
    attack(clean, bag, AttackRequest(specs))
    fixes, of_camera = read_attack_timelines(BagReader(clean), bag)["ego"]
    assert (fixes.what, of_camera.what) == ("fixes", "images")
    assert of_camera.attacks == ("camera-freeze",)
    assert set(of_camera.times_ns) <= set(fixes.times_ns)
    (section,) = coordinated_sections(clean, [bag])
    (record,) = section.records
    row = record.record()
    assert row["attacks"]["images"] == ("camera-freeze",)
    assert row["attacked_images"] == len(of_camera.times_ns) == 5


def test_two_attacks_act_one_after_the_other(camera_drive: Path, tmp_path: Path) -> None:
    """What is mirrored is then frozen; both are labelled, and verify follows them."""
    specs = (
        AttackSpec(type=f"{__name__}:Mirror", victim="ego", schedule=Schedule(from_s=0.2)),
        AttackSpec(
            type="camera-delay", parameters={"camera": "front", "delay_s": 0.1}, schedule=Schedule(to_s=0.6)
        ),
        AttackSpec(type="camera-drop", parameters={"camera": "rear"}, schedule=Schedule(from_s=0.5)),
    )
    shutil.copytree(camera_drive / "clean", tmp_path / "clean")
    attack(tmp_path / "clean", tmp_path / "both", AttackRequest(specs))
    found = labels(tmp_path / "both")
    actions = {topic: {row["image"]: [] for row in found if row["topic"] == topic} for topic in (FRONT, REAR)}
    for row in found:
        actions[row["topic"]][row["image"]].append(row["action"])
    assert actions[FRONT][3] == ["painted", "delayed"]
    assert actions[FRONT][1] == ["delayed"]
    assert actions[REAR][3] == ["dropped"]
    result = verify(tmp_path / "both")
    assert result.is_good, result.findings


@pytest.mark.parametrize(
    ("keys", "what"),
    [
        (
            {"type": "camera-drop", "parameters": {"probability": 2.0}},
            "camera-drop: probability is 2.0; it takes",
        ),
        ({"type": "camera-delay", "parameters": {"delay_s": 0.0}}, "delay_s is 0.0; it takes"),
        ({"type": "camera-blind", "parameters": {"power_w": -1.0}}, "power_w is -1.0; it takes"),
        (
            {"type": "camera-patch", "parameters": {"pattern": "randon"}},
            "pattern is 'randon'; did you mean 'random'",
        ),
        ({"type": "camera-patch", "parameters": {"width_m": 50.0}}, "width_m is 50.0; it takes"),
        (
            {"type": "camera-drop", "parameters": {"camera": "frnt"}},
            "ego has no camera 'frnt'; did you mean 'front'",
        ),
        ({"type": "camera-drop", "victim": "bus"}, "bus has no camera in"),
        ({"type": "camera-drop", "recipe": "best"}, "camera-drop has no use for recipe"),
        ({"type": "camera-drop", "schedule": {"from_s": 50}}, "begins at 50 s, but the recording ends"),
        (
            {
                "type": "camera-patch",
                "parameters": {"camera": "front", "pattern": "random", "target": "nobody"},
            },
            "shows the rear of nobody",
        ),
        (
            {
                "type": "camera-patch",
                "parameters": {"camera": "front", "pattern": "random", "width_m": 0.2, "height_m": 0.1},
            },
            "at least 50 are needed: give a target, a larger width_m and height_m, or another schedule",
        ),
        (
            {"type": "camera-patch", "parameters": {"camera": "front", "image_detector": "large"}},
            "unknown image detector 'large'",
        ),
        (
            {
                "type": "camera-patch",
                "parameters": {"camera": "front", "image_detector": "red_detector:Blind"},
            },
            "has no objectness",
        ),
        (
            {
                "type": "camera-patch",
                "parameters": {"camera": "front", "image_detector": "red_detector:Broken"},
            },
            "red_detector:Broken failed: ZeroDivisionError: integer division or modulo by zero (red_",
        ),
        (
            {"type": f"{__name__}:Mirror", "parameters": {"limit": 0.5}},
            "went beyond its bounds: share of an image",
        ),
    ],
)
def test_mistakes_are_one_line(keys: dict[str, Any], what: str, camera_drive: Path, tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError) as error:
        attack(camera_drive / "clean", tmp_path / "out", AttackRequest((AttackSpec.model_validate(keys),)))
    assert what in str(error.value)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_a_bag_without_cameras_is_refused(clean_bag: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="has no camera"):
        attack(clean_bag, tmp_path / "out", AttackRequest((AttackSpec(type="camera-drop"),)))
