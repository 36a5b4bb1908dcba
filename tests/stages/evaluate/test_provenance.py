"""Where figures come from."""

from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.provenance import transfer_remark


def test_attack_on_other_weights_is_called_a_transfer():
    attack = Comparison(None, {"detector_sha256": "a" * 64}, ())
    assert transfer_remark(attack, "a" * 64) == []
    assert transfer_remark(attack, "") == []
    assert "transfer" in transfer_remark(attack, "b" * 64)[0]
