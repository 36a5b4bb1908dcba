"""Where figures come from."""

import pytest
from place_drive import clean_cloud, write_bag

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.provenance import intensity_warning, topic_warning, transfer_warning


def test_attack_on_other_weights_is_called_a_transfer():
    def warning(sha256):
        return transfer_warning(
            Comparison(None, Provenance({"detector_sha256": "a" * 64}), (), "any", sha256)
        )

    assert warning("a" * 64) == warning("") == []
    assert "transfer" in warning("b" * 64)[0]
    about = {"detector_sha256": "a" * 64, "detector": "small"}
    (line,) = transfer_warning(Comparison(None, Provenance(about), (), "mine:One", "b" * 64))
    assert line == "Attacked against small, evaluated with mine:One: this is a transfer attack."


def test_other_clouds_than_the_attacked_ones_are_told():
    attacked = Comparison(None, Provenance({"lidar_topics": '["/ego/roof/points"]'}), ())
    assert topic_warning(attacked, "/ego/roof/points") == []
    assert topic_warning(Comparison(None, Provenance({}), ()), "/ego/lidar/points") == []
    (line,) = topic_warning(attacked, "/ego/lidar/points")
    assert line == "Attacked were the clouds of /ego/roof/points, evaluated were those of /ego/lidar/points."


@pytest.mark.parametrize(("most", "told"), [(1.0, []), (255.0, ["go up to 255."]), (float("nan"), [])])
def test_intensities_of_another_scale_are_told(tmp_path, most, told):
    cloud = clean_cloud(0)
    cloud["intensity"][3] = most
    lines = intensity_warning(write_bag(tmp_path / "clean", {}, {0: cloud}), "/ego/lidar/points")
    assert [told[0] in line for line in lines] == [True] * len(told)


def test_two_detectors_in_one_file_are_two():
    about = {"detector_sha256": "a" * 64, "detector": "mine:One"}
    assert Comparison(None, Provenance(about), (), "mine:One", "a" * 64).is_white_box is True
    assert Comparison(None, Provenance(about), (), "mine:Other", "a" * 64).is_white_box is False
    assert Comparison(None, Provenance(about), (), "renamed.safetensors", "a" * 64).is_white_box is True
