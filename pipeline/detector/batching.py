"""Several works ask one detector at once, and it answers them in batches, which a GPU does sooner.

Each work runs in a thread of its own and asks as it would ask the detector itself. All go in lock-step: a
batch is computed only when every work that has not ended waits for an answer. So what shares a batch hangs on
the works alone, never on timing.
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
    Range,
    VoxelGrid,
)
from advpipe.pipeline.messages.cloud import xyzi

T = TypeVar("T")

REQUEST_KINDS = ("occupancy_loss", "loss", "detect")
"""What is asked. Where several kinds wait, the one that most works ask is computed, and the others go on
waiting: works that fell out of step are soon in step again."""


def run_batched(detector: BatchDetector, works: Sequence[Callable[[ObjectDetector], T]]) -> list[T]:
    """The results of the works, each called with a detector that answers in batches.

    Losses that it gives are differentiated once: their gradient is computed with them, if gradients are on in
    the thread that asks. What one input does wrong is raised where it was asked alone, and so is what only a
    batch is too large for: its inputs are then computed one by one. The first error that a work does not
    catch, in the order of the works, ends all of them and is raised here; so does ctrl-C.
    """
    return _Together(detector, works).run()


class _EndedError(BaseException):
    """Another work failed, or the user has had enough; no work should catch it."""


@dataclass(frozen=True)
class _Question:
    """given: a LossInput, or for "detect" the cloud (N, 4). wants_gradient: to points and occupancy."""

    kind: str
    given: Any
    wants_gradient: bool = False


@dataclass(frozen=True)
class _Answer:
    """A loss with what `occupancy_loss` tells besides, and its gradients to the points and the occupancy."""

    loss: Tensor
    extra: tuple[Tensor, ...]
    gradients: tuple[Tensor | None, ...]


@dataclass(frozen=True)
class _End:
    """How a work ended."""

    result: Any = None
    error: BaseException | None = None


class _Together:
    def __init__(self, detector: BatchDetector, works: Sequence[Callable[[ObjectDetector], Any]]) -> None:
        self._detector, self._works = detector, works
        self._inbox: SimpleQueue[tuple[int, _Question | _End]] = SimpleQueue()
        self._outboxes: list[SimpleQueue[Any]] = [SimpleQueue() for _ in works]

    def run(self) -> list[Any]:
        threads = [
            threading.Thread(target=self._work, args=(number,), daemon=True)
            for number in range(len(self._works))
        ]
        ends: dict[int, _End] = {}
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
        return [ends[number].result for number in range(len(self._works))]

    def _serve(self, ends: dict[int, _End]) -> None:
        """Answer until all works have ended."""
        waiting: dict[int, _Question] = {}
        while True:
            while len(waiting) + len(ends) < len(self._works):
                number, said = self._inbox.get()
                if isinstance(said, _End):
                    ends[number] = said
                else:
                    waiting[number] = said
            for _, end in sorted(ends.items()):
                if end.error is not None:
                    raise end.error
            if not waiting:
                return
            asked = [question.kind for question in waiting.values()]
            kind = max(REQUEST_KINDS, key=asked.count)
            numbers = sorted(number for number, question in waiting.items() if question.kind == kind)
            answers = _answers(self._detector, kind, [waiting.pop(number) for number in numbers])
            for number, answer in zip(numbers, answers, strict=True):
                self._outboxes[number].put(answer)

    def _work(self, number: int) -> None:
        """What a thread does."""
        try:
            end = _End(result=self._works[number](_Asking(self._detector, self._ask, number)))
        except _EndedError:
            return
        except BaseException as error:
            end = _End(error=error)
        self._inbox.put((number, end))

    def _ask(self, number: int, question: _Question) -> Any:
        self._inbox.put((number, question))
        answer = self._outboxes[number].get()
        if isinstance(answer, _EndedError):
            self._outboxes[number].put(answer)  # for a work that asks again all the same
        if isinstance(answer, BaseException):
            raise answer
        return answer


class _Asking:
    """A `VoxelDetector` that waits until its questions are answered."""

    def __init__(self, detector: BatchDetector, ask: Callable[[int, _Question], Any], number: int) -> None:
        self._detector, self._put, self._number = detector, ask, number

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
        found: Detections = self._put(self._number, _Question("detect", torch.from_numpy(xyzi(cloud))))
        return found

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        answer = self._ask("loss", LossInput(points, boxes, labels), needed=points.requires_grad)
        return _differentiable(answer, points)

    def occupancy_loss(
        self, points: Tensor, boxes: Tensor, labels: Tensor, probes: Tensor | None = None
    ) -> tuple[Tensor, Tensor, Tensor]:
        answer = self._ask("occupancy_loss", LossInput(points, boxes, labels, probes), needed=True)
        occupancy, rows = answer.extra
        occupancy.requires_grad_()
        return _differentiable(answer, points, occupancy), occupancy, rows

    def _ask(self, kind: str, given: LossInput, *, needed: bool) -> _Answer:
        points = given.points.detach().requires_grad_(given.points.requires_grad)
        question = _Question(kind, replace(given, points=points), needed and torch.is_grad_enabled())
        answer: _Answer = self._put(self._number, question)
        return answer


def _answers(detector: BatchDetector, kind: str, questions: Sequence[_Question]) -> list[Any]:
    """The answers to questions of one kind; in place of one that failed, its error."""
    try:
        if kind == "detect":
            return list(detector.detect_batch([question.given for question in questions]))
        return _loss_answers(detector, kind, questions)
    except Exception as error:
        if len(questions) == 1:
            return [error]
    # Only here has what the batch held been let go of; it may have been too much.
    return [answer for question in questions for answer in _answers(detector, kind, [question])]


def _loss_answers(detector: BatchDetector, kind: str, questions: Sequence[_Question]) -> list[_Answer]:
    """One pass forward, and one backward if any gradient is wanted, for all of them."""
    inputs: list[LossInput] = [question.given for question in questions]
    wanted = [question.wants_gradient for question in questions]
    with torch.set_grad_enabled(any(wanted)):
        found: list[tuple[Tensor, ...]]
        if kind == "loss":
            found = [(loss,) for loss in detector.loss_batch(inputs)]
        else:
            found = list(detector.occupancy_loss_batch(inputs))
    # Each depends on leaves of its own only, so the gradient of their sum is that of each.
    leaves = [
        (each.points, *extra[:1]) if wants else ()
        for each, (_, *extra), wants in zip(inputs, found, wanted, strict=True)
    ]
    asked = [leaf for of_one in leaves for leaf in of_one if leaf.requires_grad]
    losses = [loss for (loss, *_), wants in zip(found, wanted, strict=True) if wants and loss.requires_grad]
    gradients: dict[int, Tensor] = {}
    if losses and asked:
        computed = torch.autograd.grad(losses, asked, allow_unused=True, materialize_grads=True)
        gradients = {id(leaf): gradient for leaf, gradient in zip(asked, computed, strict=True)}
    return [
        _Answer(
            loss.detach(),
            tuple(part.detach() for part in extra),
            tuple(gradients.get(id(leaf)) for leaf in of_one),
        )
        for (loss, *extra), of_one in zip(found, leaves, strict=True)
    ]


def _differentiable(answer: _Answer, *leaves: Tensor) -> Tensor:
    """The loss, which knows its gradients to these."""
    loss: Tensor = _Known.apply(answer.loss, answer.gradients, *leaves)  # type: ignore[no-untyped-call]
    return loss


class _Known(torch.autograd.Function):
    """A loss whose gradients to the leaves were computed with it; there are no second derivatives."""

    @staticmethod
    def forward(ctx: Any, loss: Tensor, gradients: tuple[Tensor | None, ...], *leaves: Tensor) -> Tensor:
        ctx.gradients = gradients
        return loss.clone()

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        return None, None, *(None if known is None else grad * known for known in ctx.gradients)
