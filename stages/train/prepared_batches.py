"""Batches for a GPU, which computes all clouds of a batch together while processes prepare the next ones."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from advpipe.pipeline.core import signals
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common.network import DetectionNetwork, LabelledPoints
from advpipe.pipeline.detector.families import family_named
from advpipe.stages.train.examples import Examples

AHEAD = 2
"""Batches that each process has ready."""


class PreparedBatches(Dataset[list[LabelledPoints]]):
    """The clouds of each step, by number, with what a head is to learn from them."""

    def __init__(self, examples: Examples) -> None:
        self.examples = examples
        self._net: DetectionNetwork | None = None

    def __getitem__(self, step: int) -> list[LabelledPoints]:
        if self._net is None:  # each process has one, for its targets alone
            preset = self.examples.preset
            self._net = family_named(preset.family).network(preset.name)
        size = self.examples.config.batch_size
        return [self.examples.with_targets(step * size + b, self._net) for b in range(size)]


class BatchGradients:
    """The mean gradient over a batch that a GPU computes at once: `workers.Gradients`.

    All clouds of a batch share batch norm statistics, unlike on a CPU, where each has its own: the weights
    that come out differ.
    """

    def __init__(self, net: DetectionNetwork, examples: Examples, processes: int) -> None:
        self._net, self._examples, self._processes = net, examples, processes
        self._batches: Iterator[list[LabelledPoints]] | None = None

    def __call__(self, step: int) -> Tensor:
        if self._batches is None:
            self._batches = self._from(step)
        try:
            batch = next(self._batches)
        except Exception as error:  # of a process, with its whole traceback as the message
            reason = str(error).strip().splitlines()[-1]
            raise AdvpipeError(f"a training process stopped at step {step}: {reason}") from None
        self._net.train().zero_grad()
        clouds = [cloud.to(self._net.device) for cloud in batch]
        parts = self._net.batch_losses(clouds, bf16=self._examples.config.bf16)
        parts.sum().backward()  # type: ignore[no-untyped-call]
        return parts.detach()

    def _from(self, step: int) -> Iterator[list[LabelledPoints]]:
        """The batches of all steps from this one on."""
        loader = DataLoader(
            PreparedBatches(self._examples),
            batch_size=None,
            sampler=count(step),
            num_workers=self._processes,
            prefetch_factor=AHEAD if self._processes else None,
            # A process that holds a GPU may not fork.
            multiprocessing_context="spawn" if self._processes else None,
            worker_init_fn=_prepare_process,
        )
        return iter(loader)


def _prepare_process(_: int) -> None:
    signals.leave_to_parent()
    torch.set_num_threads(1)


@contextmanager
def unordered_sums() -> Iterator[None]:
    """PyTorch may sum in any order within the block: `open_device` forbids it, at several times the cost of a
    sparse convolution, whose own sums have one term for each place."""
    was = torch.are_deterministic_algorithms_enabled()
    torch.use_deterministic_algorithms(False)
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(was, warn_only=True)
