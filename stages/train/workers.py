"""Gradients of several clouds in parallel: one process with one thread for each share of the batch.

A cloud is small for a network with many short layers, so two processes of one thread are faster than
one process of two, and far less affected by other load on the machine. Each cloud has its own batch norm
statistics; therefore the result does not depend on the number of processes. On a GPU, see
`prepared_batches`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any, Protocol

import torch
from torch import Tensor, multiprocessing, nn

from advpipe.pipeline.core import signals
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common.network import DetectionNetwork
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.families import family_named
from advpipe.stages.train.examples import Examples
from advpipe.stages.train.prepared_batches import BatchGradients, unordered_sums


class Gradients(Protocol):
    """The mean gradient over the clouds of a batch."""

    def __call__(self, step: int) -> Tensor:
        """Set the gradients and batch norm averages of the network; return the losses (P,) of its
        `LOSS_PARTS`."""


class Replica:
    """A network that shares the weights of another one, with separate batch norm averages."""

    def __init__(self, net: DetectionNetwork, examples: Examples) -> None:
        self.source, self.examples = net, examples
        replica = family_named(net.preset.family).network(net.preset.name)
        self.net: DetectionNetwork = replica.to(net.device, memory_format=torch.channels_last).train()  # type: ignore[call-overload]
        for own, shared in zip(self.net.parameters(), net.parameters(), strict=True):
            own.data = shared.data

    def result(self, index: int) -> Tensor:
        """Losses, gradients and batch norm averages after example `index`, as one row (`row_length`,)."""
        for own, shared in zip(averages(self.net), averages(self.source), strict=True):
            own.copy_(shared)
        self.net.zero_grad()
        example = self.examples[index].to(self.net.device)
        parts = torch.stack(self.net.training_losses(example, bf16=self.examples.config.bf16))
        parts.sum().backward()  # type: ignore[no-untyped-call]
        values = [parts.detach()]
        values += [p.grad.reshape(-1) for p in self.net.parameters() if p.grad is not None]
        return torch.cat([*values, *averages(self.net)])


def averages(net: nn.Module) -> list[Tensor]:
    """The running means and variances of the batch norms."""
    return [b for name, b in net.named_buffers() if name.endswith(("running_mean", "running_var"))]


def row_length(net: DetectionNetwork) -> int:
    """The length of a row of losses, gradients and batch norm averages."""
    return len(net.LOSS_PARTS) + sum(t.numel() for t in [*net.parameters(), *averages(net)])


def take(row: Tensor, net: DetectionNetwork) -> Tensor:
    """Set gradients and batch norm averages of the network from a row; return the losses."""
    at = len(net.LOSS_PARTS)
    for parameter in net.parameters():
        parameter.grad = row[at : at + parameter.numel()].view(parameter.shape)
        at += parameter.numel()
    for average in averages(net):
        average.copy_(row[at : at + average.numel()])
        at += average.numel()
    return row[: len(net.LOSS_PARTS)]


@contextmanager
def gradients(net: DetectionNetwork, examples: Examples, workers: int) -> Iterator[Gradients]:
    """The gradients of `net` on its examples, computed by this many worker processes, or in this process for
    one."""
    batch, device = examples.config.batch_size, net.device
    if device.type != CPU:
        with unordered_sums():
            yield BatchGradients(net, examples, workers)
        return
    rows = torch.zeros(batch, row_length(net), device=device)
    workers = min(workers, batch)
    if workers <= 1:
        replica, threads = Replica(net, examples), torch.get_num_threads()

        def here(step: int) -> Tensor:
            for b in range(batch):
                rows[b] = replica.result(step * batch + b)
            return take(rows.mean(0), net)

        torch.set_num_threads(1)
        try:
            yield here
        finally:
            torch.set_num_threads(threads)
        return

    try:
        rows.share_memory_()  # type: ignore[no-untyped-call]
        net.share_memory()
    except RuntimeError as error:
        reason = str(error).splitlines()[0]
        raise AdvpipeError(f"no shared memory for {workers} processes: {reason}; free some") from None
    # Forking is fast and needs no __main__ guard in a caller's script; on other systems it is unsafe.
    context: Any = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    with ExitStack() as stack:
        pipes: list[Connection] = []
        for worker in range(workers):
            own, worker_end = context.Pipe()
            share = range(worker, batch, workers)
            arguments = (net, examples, rows, share, worker_end, [*pipes, own])
            process = context.Process(target=_work, args=arguments, daemon=True)
            with signals.blocked():  # until the worker has set its signal handling
                process.start()
                stack.callback(process.join)
                stack.callback(own.close)
            worker_end.close()
            pipes.append(own)

        def elsewhere(step: int) -> Tensor:
            try:
                for pipe in pipes:
                    pipe.send(step)
                failures = [pipe.recv() for pipe in pipes]
            except (EOFError, OSError):
                failures = ["it was killed; is there enough memory?"]
            for failure in filter(None, failures):
                raise AdvpipeError(f"a training process stopped at step {step}: {failure}")
            return take(rows.mean(0), net)

        yield elsewhere


def _work(
    net: DetectionNetwork,
    examples: Examples,
    rows: Tensor,
    share: range,
    pipe: Connection,
    inherited: list[Connection],
) -> None:
    """Compute each step that comes through the pipe, until it closes."""
    signals.leave_to_parent()
    # Only the parent may hold its ends of the pipes: otherwise its death would not close them.
    for connection in inherited:
        connection.close()
    torch.set_num_threads(1)
    replica = Replica(net, examples)
    with suppress(EOFError, OSError):  # the pipe was closed at the end of the run
        while True:
            step, failure = pipe.recv(), None
            try:
                for b in share:
                    rows[b] = replica.result(step * len(rows) + b)
            except Exception as error:
                failure = f"{type(error).__name__}: {error}"
            pipe.send(failure)
