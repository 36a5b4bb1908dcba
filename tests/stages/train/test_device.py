"""Training on a GPU, where there is one: the same first steps as on the CPU."""

from __future__ import annotations

import pytest
import torch

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.registry import load_detector
from advpipe.stages.train import run
from advpipe.stages.train.config import TrainConfig


def config_on(device, drive, out):
    return TrainConfig(bags=(drive,), out=out, preset="tiny", steps=2, workers=1, device=device)


def test_an_unknown_device_creates_no_folder(drive, tiny, tmp_path):
    with pytest.raises(AdvpipeError, match="unknown device 'gpu'"):
        run.train(config_on("gpu", drive, tmp_path / "run"))
    assert not (tmp_path / "run").exists()


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA GPU")
def test_cuda_takes_the_same_steps_up_to_rounding(drive, tiny, tmp_path):
    summaries = [run.train(config_on(device, drive, tmp_path / device)) for device in ("cpu", "cuda")]
    near, far = (load_detector(str(summary.checkpoint)) for summary in summaries)
    assert (near.provenance.get("device"), far.provenance["device"]) == (None, "cuda")
    ours = far.net.state_dict()
    for name, value in near.net.state_dict().items():
        torch.testing.assert_close(ours[name], value, rtol=1e-2, atol=1e-2)
