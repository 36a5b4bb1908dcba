"""A run of one family may start from the layers that it shares with another."""

from __future__ import annotations

import pytest
import torch

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.checkpoint import load_checkpoint
from advpipe.pipeline.detector.families import family_named
from advpipe.pipeline.detector.second.family import SHIPPED
from advpipe.stages.train.start import start_from


def test_centerpoint_takes_the_backbone_of_second(capsys):
    net, path = family_named("centerpoint").network("small"), SHIPPED["small"]
    before = {name: weights.clone() for name, weights in net.state_dict().items()}
    start_from(net, path)
    second, after = load_checkpoint(path).net.state_dict(), net.state_dict()
    backbone = [name for name in after if name.startswith("backbone3d.")]
    assert backbone
    assert all(torch.equal(after[name], second[name]) for name in backbone)
    assert all(torch.equal(after[name], before[name]) for name in after if name.startswith("head."))
    assert "'centerpoint' starts from 1,2" in capsys.readouterr().err


@pytest.mark.parametrize(("family", "preset"), [("pointpillars", "small"), ("second", "360")])
def test_a_network_that_shares_too_little_is_refused(family, preset):
    net, path = family_named(family).network(preset), SHIPPED["small"]
    with pytest.raises(UsageError, match=r"has too few of the layers of preset .* leave out --start$"):
        start_from(net, path)
