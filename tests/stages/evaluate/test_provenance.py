"""Where figures come from."""

import hashlib

from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.provenance import checkpoint_sha256, transfer_remark


def test_checksum_of_the_weights(tmp_path):
    (tmp_path / "mine.safetensors").write_bytes(b"weights")
    assert checkpoint_sha256(str(tmp_path / "mine.safetensors")) == hashlib.sha256(b"weights").hexdigest()
    assert checkpoint_sha256("package.module:Class") is None


def test_attack_on_other_weights_is_called_a_transfer():
    attack = Comparison(None, {"detector_sha256": "a" * 64}, ())
    assert transfer_remark(attack, "a" * 64) == []
    assert transfer_remark(attack, None) == []
    assert "transfer" in transfer_remark(attack, "b" * 64)[0]
