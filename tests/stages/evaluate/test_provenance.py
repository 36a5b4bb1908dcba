"""Where figures come from."""

import pytest
from place_drive import clean_cloud, write_bag

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.provenance import comparison_warnings

TOPIC = "/ego/lidar/points"
OF_TOPIC = Options(lidar_topic=TOPIC)


@pytest.fixture
def clean(tmp_path):
    return write_bag(tmp_path / "clean", {}, {0: clean_cloud(0)})


def test_attack_on_other_weights_is_called_a_transfer(clean):
    def warnings(about, detector, sha256):
        return comparison_warnings(Comparison(None, Provenance(about), (), detector, sha256), clean, OF_TOPIC)

    about = {"detector_sha256": "a" * 64}
    assert warnings(about, "any", "a" * 64) == warnings(about, "any", "") == []
    assert "transfer" in warnings(about, "any", "b" * 64)[0]
    assert warnings({**about, "detector": "small"}, "mine:One", "b" * 64) == [
        "Attacked against small, evaluated with mine:One: this is a transfer attack."
    ]


def test_other_clouds_than_the_attacked_ones_are_reported(clean):
    def warnings(about):
        return comparison_warnings(Comparison(None, Provenance(about), ()), clean, Options())

    assert warnings({}) == warnings({"lidar_topics": f'["{TOPIC}"]'}) == []
    assert warnings({"lidar_topics": '["/ego/roof/points"]'}) == [
        f"Attacked were the clouds of /ego/roof/points, evaluated were those of {TOPIC}."
    ]


@pytest.mark.parametrize(("most", "stated"), [(1.0, []), (255.0, ["go up to 255."]), (float("nan"), [])])
def test_intensities_of_another_scale_are_reported(tmp_path, most, stated):
    cloud = clean_cloud(0)
    cloud["intensity"][3] = most
    bag = write_bag(tmp_path / "bright", {}, {0: cloud})
    lines = comparison_warnings(Comparison(None, Provenance({}), ()), bag, OF_TOPIC)
    assert [stated[0] in line for line in lines] == [True] * len(stated)


def test_two_detectors_in_one_file_are_two():
    about = {"detector_sha256": "a" * 64, "detector": "mine:One"}
    assert Comparison(None, Provenance(about), (), "mine:One", "a" * 64).is_white_box is True
    assert Comparison(None, Provenance(about), (), "mine:Other", "a" * 64).is_white_box is False
    assert Comparison(None, Provenance(about), (), "renamed.safetensors", "a" * 64).is_white_box is True
