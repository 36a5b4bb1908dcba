"""A CARLA server in synchronous mode: its clock follows the drive's, step by step."""

from __future__ import annotations

from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError, UsageError

SUBSTEP_S, SUBSTEPS = 0.01, 10
"""CARLA's default longest substep of its physics, and the most in a step."""

LONGEST_SUBSTEP_S, MOST_SUBSTEPS = 0.0166, 16
"""The largest values that CARLA accepts."""

TOLERANCE_S = 1e-3


def check_step(step_s: float) -> None:
    """Raise UsageError for a step that CARLA's physics cannot follow."""
    if step_s > LONGEST_SUBSTEP_S * MOST_SUBSTEPS:
        raise UsageError(
            f"simulation.step_s is {step_s:g} s, but CARLA's physics allows steps of at most "
            f"{LONGEST_SUBSTEP_S * MOST_SUBSTEPS:.2f} s; lower it"
        )


class Session:
    """Synchronous from `begin` to `end`. Only this client may tick the server meanwhile."""

    def __init__(self, client: Any, world: Any, step_s: float) -> None:
        self._client, self.world, self.step_s = client, world, step_s
        self._frame: int | None = None
        self._elapsed_s = 0.0

    def begin(self) -> None:
        """Switch to synchronous mode with the drive's step; this takes some ticks by itself."""
        settings = self.world.get_settings()
        settings.synchronous_mode, settings.fixed_delta_seconds = True, self.step_s
        settings.substepping, settings.deterministic_ragdolls = True, True
        settings.max_substep_delta_time, settings.max_substeps = SUBSTEP_S, SUBSTEPS
        if self.step_s > SUBSTEP_S * SUBSTEPS:
            settings.max_substep_delta_time, settings.max_substeps = LONGEST_SUBSTEP_S, MOST_SUBSTEPS
        self.world.apply_settings(settings)

    def tick(self) -> Any:
        """One step; the snapshot of all actors after it.

        Raises AdvpipeError if another client ticks, too, or the server's step is not ours.
        """
        frame = self.world.tick()
        snapshot = self.world.get_snapshot()
        if self._frame is not None and not snapshot.frame == frame == self._frame + 1:
            raise AdvpipeError(
                f"CARLA went from frame {self._frame} to {max(frame, snapshot.frame)} in one step: another "
                "client ticks the server, too; stop it, or run it without ticking"
            )
        elapsed_s = snapshot.timestamp.elapsed_seconds
        if self._frame is not None and abs(elapsed_s - self._elapsed_s - self.step_s) > TOLERANCE_S:
            raise AdvpipeError(
                f"CARLA's clock moved on by {elapsed_s - self._elapsed_s:g} s in a step of {self.step_s:g} s"
            )
        self._frame, self._elapsed_s = frame, elapsed_s
        return snapshot

    def end(self) -> None:
        """Back to asynchronous mode, in which the server runs for the next client; also after errors."""
        settings = self.world.get_settings()
        settings.synchronous_mode, settings.fixed_delta_seconds = False, None
        self.world.apply_settings(settings)
