"""Batches that a GPU computes at once, here on the CPU, with and without processes that prepare them."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.families import family_named
from advpipe.stages.train.config import TrainConfig
from advpipe.stages.train.examples import Examples
from advpipe.stages.train.frames import FrameStore, cropped
from advpipe.stages.train.prepared_batches import BatchGradients, unordered_sums


@pytest.fixture
def examples(drive: Path, tmp_path: Path, tiny: str) -> Examples:
    store = FrameStore.build(
        (cropped(frame, 20.0) for frame in read_frames(resolve_bag(drive))), tmp_path / "frames", "key"
    )
    return Examples(store, TrainConfig(bags=(drive,), out=tmp_path, preset=tiny, batch_size=2))


def gradients(examples: Examples, step: int, processes: int) -> tuple[torch.Tensor, torch.Tensor]:
    torch.manual_seed(0)
    net = family_named("second").network(examples.preset.name)
    losses = BatchGradients(net, examples, processes)(step)
    return losses, torch.cat([p.grad.flatten() for p in net.parameters() if p.grad is not None])


def test_losses_and_gradients_are_those_of_both_clouds_together(examples: Examples) -> None:
    losses, gradient = gradients(examples, 3, 0)
    torch.manual_seed(0)
    net = family_named("second").network(examples.preset.name).train()
    together = net.batch_losses([examples[6], examples[7]])
    together.sum().backward()
    expected = torch.cat([p.grad.flatten() for p in net.parameters() if p.grad is not None])
    torch.testing.assert_close(losses, together.detach())
    torch.testing.assert_close(gradient, expected)
    assert losses.shape == (len(net.LOSS_PARTS),)


def test_targets_made_ahead_are_those_of_the_loss(examples: Examples) -> None:
    net = family_named("second").network(examples.preset.name).eval()
    alone = [torch.stack(net.training_losses(examples[index])) for index in (0, 1)]
    together = net.batch_losses([examples.with_targets(index, net) for index in (0, 1)])
    torch.testing.assert_close(together, torch.stack(alone).mean(0), rtol=1e-4, atol=1e-5)


def test_a_broken_store_is_one_line(examples: Examples) -> None:
    (examples.store.folder / "points.bin").unlink()
    with pytest.raises(AdvpipeError, match=r"a training process stopped at step 0: .*points\.bin") as caught:
        gradients(examples, 0, 0)
    assert "\n" not in str(caught.value)


def test_processes_prepare_the_same_batches(examples: Examples) -> None:
    # In a process of its own the preset of these tests is unknown: the shipped sizes are prepared.
    config = TrainConfig(bags=examples.config.bags, out=examples.config.out, batch_size=2)
    whole = Examples(examples.store, config)
    here, elsewhere = (gradients(whole, 0, processes)[0] for processes in (0, 1))
    torch.testing.assert_close(here, elsewhere)


def test_the_order_of_sums_is_free_within_the_block_alone() -> None:
    torch.use_deterministic_algorithms(True, warn_only=True)
    try:
        with unordered_sums():
            assert not torch.are_deterministic_algorithms_enabled()
        assert torch.are_deterministic_algorithms_enabled()
    finally:
        torch.use_deterministic_algorithms(False)
