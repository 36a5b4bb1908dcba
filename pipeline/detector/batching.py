"""Several tasks share one detector, which computes their requests in batches: faster on a GPU.

Each task runs in its own thread and calls the detector as usual. All tasks run in lock-step: a
batch is computed only when every unfinished task waits for a response. So the composition of a batch depends
on the tasks alone, never on timing.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from queue import SimpleQueue
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from advpipe.pipeline.detector.protocol import (
    BatchDetector,
    Detections,
    LossInput,
    ObjectDetector,
    OccupancyLoss,
    Range,
    VoxelGrid,
)
from advpipe.pipeline.messages.cloud import xyzi

T = TypeVar("T")

REQUEST_TYPES = ("occupancy_loss", "loss", "detect")
"""The types of requests. If requests of several types wait, the most frequent type is computed, and the
others keep waiting: tasks that are out of step are soon in step again."""


def run_batched(detector: BatchDetector, tasks: Sequence[Callable[[ObjectDetector], T]]) -> list[T]:
    """Run the tasks concurrently, each with a detector that computes in batches; return their results.

    Its losses can be differentiated once: their gradient is computed with them, if gradients are enabled in
    the calling thread. An error of one input is raised only in the task that requested it; if a batch is too
    large, its inputs are computed one by one. The first error that a task does not catch, in the order of the
    tasks, stops all of them and is raised here; so is Ctrl-C.
    """
    return _BatchScheduler(detector, tasks).run()


class _EndedError(BaseException):
    """Another task failed, or the user pressed Ctrl-C; tasks should not catch it."""


@dataclass(frozen=True)
class _Request:
    """given: a LossInput, or for "detect" the cloud (N, 4). wants_gradient: with respect to points and
    occupancy."""

    request_type: str
    given: Any
    wants_gradient: bool = False


@dataclass(frozen=True)
class _Response:
    """A loss, the gradients to the points and the occupancy, and the whole result of `occupancy_loss`."""

    loss: Tensor
    gradients: tuple[Tensor | None, ...]
    computed: OccupancyLoss | None = None


@dataclass(frozen=True)
class _Completion:
    """The result or error of a finished task."""

    result: Any = None
    error: BaseException | None = None


class _BatchScheduler:
    def __init__(self, detector: BatchDetector, tasks: Sequence[Callable[[ObjectDetector], Any]]) -> None:
        self._detector, self._tasks = detector, tasks
        self._inbox: SimpleQueue[tuple[int, _Request | _Completion]] = SimpleQueue()
        self._outboxes: list[SimpleQueue[Any]] = [SimpleQueue() for _ in tasks]

    def run(self) -> list[Any]:
        threads = [
            threading.Thread(target=self._run_task, args=(number,), daemon=True)
            for number in range(len(self._tasks))
        ]
        ends: dict[int, _Completion] = {}
        try:
            for thread in threads:
                thread.start()
            self._serve(ends)
        finally:
            for outbox in self._outboxes:
                outbox.put(_EndedError())
            for thread in threads:
                if thread.ident is not None:
                    thread.join()
        return [ends[number].result for number in range(len(self._tasks))]

    def _serve(self, ends: dict[int, _Completion]) -> None:
        """Serve requests until all tasks have finished."""
        waiting: dict[int, _Request] = {}
        while True:
            while len(waiting) + len(ends) < len(self._tasks):
                number, item = self._inbox.get()
                if isinstance(item, _Completion):
                    ends[number] = item
                else:
                    waiting[number] = item
            for _, end in sorted(ends.items()):
                if end.error is not None:
                    raise end.error
            if not waiting:
                return
            requested = [request.request_type for request in waiting.values()]
            request_type = max(REQUEST_TYPES, key=requested.count)
            numbers = sorted(
                number for number, request in waiting.items() if request.request_type == request_type
            )
            responses = _responses(self._detector, request_type, [waiting.pop(number) for number in numbers])
            for number, response in zip(numbers, responses, strict=True):
                self._outboxes[number].put(response)

    def _run_task(self, number: int) -> None:
        """Run one task in its thread."""
        try:
            end = _Completion(
                result=self._tasks[number](_BatchingProxy(self._detector, self._request, number))
            )
        except _EndedError:
            return
        except BaseException as error:
            end = _Completion(error=error)
        self._inbox.put((number, end))

    def _request(self, number: int, request: _Request) -> Any:
        self._inbox.put((number, request))
        response = self._outboxes[number].get()
        if isinstance(response, _EndedError):
            self._outboxes[number].put(response)  # for a task that caught it and sends another request
        if isinstance(response, BaseException):
            raise response
        return response


class _BatchingProxy:
    """A `VoxelDetector` that forwards requests to the scheduler and waits for the responses."""

    def __init__(self, detector: BatchDetector, request: Callable[[int, _Request], Any], number: int) -> None:
        self._detector, self._put, self._number = detector, request, number

    @property
    def classes(self) -> tuple[str, ...]:
        return self._detector.classes

    @property
    def range_m(self) -> Range:
        return self._detector.range_m

    @property
    def voxel_grid(self) -> VoxelGrid:
        return self._detector.voxel_grid

    def detect(self, cloud: npt.NDArray[np.void]) -> Detections:
        found: Detections = self._put(self._number, _Request("detect", torch.from_numpy(xyzi(cloud))))
        return found

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        response = self._request("loss", LossInput(points, boxes, labels), needed=points.requires_grad)
        return _differentiable(response, points)

    def occupancy_loss(
        self, points: Tensor, boxes: Tensor, labels: Tensor, probes: Tensor | None = None
    ) -> OccupancyLoss:
        response = self._request("occupancy_loss", LossInput(points, boxes, labels, probes), needed=True)
        assert response.computed is not None
        occupancy = response.computed.occupancy.requires_grad_()
        return replace(response.computed, loss=_differentiable(response, points, occupancy))

    def _request(self, request_type: str, given: LossInput, *, needed: bool) -> _Response:
        points = given.points.detach().requires_grad_(given.points.requires_grad)
        request = _Request(request_type, replace(given, points=points), needed and torch.is_grad_enabled())
        response: _Response = self._put(self._number, request)
        return response


def _responses(detector: BatchDetector, request_type: str, requests: Sequence[_Request]) -> list[Any]:
    """The responses to requests of one type; an error in place of a failed one."""
    try:
        if request_type == "detect":
            return list(detector.detect_batch([request.given for request in requests]))
        return _loss_responses(detector, request_type, requests)
    except Exception as error:
        if len(requests) == 1:
            return [error]
    # Only here has the memory of the failed batch been released; it may have been too much.
    return [response for request in requests for response in _responses(detector, request_type, [request])]


def _loss_responses(
    detector: BatchDetector, request_type: str, requests: Sequence[_Request]
) -> list[_Response]:
    """One forward pass for all requests, and one backward pass if any wants a gradient."""
    inputs: list[LossInput] = [request.given for request in requests]
    wanted = [request.wants_gradient for request in requests]
    with torch.set_grad_enabled(any(wanted)):
        computed: list[OccupancyLoss | None] = [None] * len(inputs)
        if request_type == "loss":
            losses = detector.loss_batch(inputs)
        else:
            computed = list(detector.occupancy_loss_batch(inputs))
            losses = [each.loss for each in computed if each is not None]
    # Each loss depends only on its own leaves, so the gradient of the sum is the gradient of each.
    leaves = [
        (given.points,) if each is None else (given.points, each.occupancy)
        for given, each in zip(inputs, computed, strict=True)
    ]
    requested = [
        leaf
        for of_one, wants in zip(leaves, wanted, strict=True)
        for leaf in of_one
        if wants and leaf.requires_grad
    ]
    summands = [loss for loss, wants in zip(losses, wanted, strict=True) if wants and loss.requires_grad]
    gradients: dict[int, Tensor] = {}
    if summands and requested:
        found = torch.autograd.grad(summands, requested, allow_unused=True, materialize_grads=True)
        gradients = {id(leaf): gradient for leaf, gradient in zip(requested, found, strict=True)}
    return [
        _Response(
            loss.detach(),
            tuple(gradients.get(id(leaf)) for leaf in of_one),
            None if each is None else replace(each, loss=loss.detach(), occupancy=each.occupancy.detach()),
        )
        for loss, of_one, each in zip(losses, leaves, computed, strict=True)
    ]


def _differentiable(response: _Response, *leaves: Tensor) -> Tensor:
    """The loss with its precomputed gradients to these leaves."""
    loss: Tensor = _PrecomputedLoss.apply(response.loss, response.gradients, *leaves)  # type: ignore[no-untyped-call]
    return loss


class _PrecomputedLoss(torch.autograd.Function):
    """A loss with precomputed gradients to the leaves; second derivatives are not available."""

    @staticmethod
    def forward(ctx: Any, loss: Tensor, gradients: tuple[Tensor | None, ...], *leaves: Tensor) -> Tensor:
        ctx.gradients = gradients
        return loss.clone()

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        return None, None, *(None if known is None else grad * known for known in ctx.gradients)
