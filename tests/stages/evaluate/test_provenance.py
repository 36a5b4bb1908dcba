"""Where figures come from."""

from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.provenance import transfer_remark


def test_attack_on_other_weights_is_called_a_transfer():
    def remark(sha256):
        return transfer_remark(Comparison(None, {"detector_sha256": "a" * 64}, (), "any", sha256))

    assert remark("a" * 64) == remark("") == []
    assert "transfer" in remark("b" * 64)[0]


def test_two_detectors_in_one_file_are_two():
    about = {"detector_sha256": "a" * 64, "detector": "mine:One"}
    assert Comparison(None, about, (), "mine:One", "a" * 64).is_white_box is True
    assert Comparison(None, about, (), "mine:Other", "a" * 64).is_white_box is False
    assert Comparison(None, about, (), "renamed.safetensors", "a" * 64).is_white_box is True
