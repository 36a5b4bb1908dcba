"""The state of a run, from which it resumes as if it had never stopped."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.option_names import option_name


@dataclass
class TrainState:
    """The network, the optimiser and the next step."""

    net: nn.Module
    optimiser: torch.optim.AdamW
    step: int = 0

    @classmethod
    def new(cls, net: nn.Module, learning_rate: float, weight_decay: float) -> TrainState:
        """The state before the first step, with AdamW."""
        optimiser = torch.optim.AdamW(
            net.parameters(), learning_rate, betas=(0.9, 0.99), weight_decay=weight_decay
        )
        return cls(net, optimiser)

    def diverged(self) -> AdvpipeError:
        """The error for a loss or weights that are not finite."""
        rate = float(self.optimiser.param_groups[0]["lr"])
        return AdvpipeError(
            f"the loss is not finite at step {self.step}, at a learning rate of {rate:.3g}; "
            f"lower {option_name('learning_rate')} (3e-3 by default)"
        )

    def require_finite(self) -> None:
        """Raise AdvpipeError for weights that a checkpoint cannot store: infinite, or beyond half
        precision."""
        for weights in self.net.state_dict().values():
            # Weights of more than one dimension are stored in half precision.
            dtype = torch.float16 if weights.ndim > 1 else torch.float32
            if weights.is_floating_point() and not weights.abs().max() <= torch.finfo(dtype).max:
                raise self.diverged()

    def save(self, path: Path) -> None:
        """Save the state atomically; see also `require_finite`."""
        self.require_finite()
        state = {
            "step": self.step,
            "net": self.net.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "random": torch.get_rng_state(),
        }
        buffer = io.BytesIO()
        torch.save(state, buffer)  # writing to a file directly would hide the reason of a disk error
        write_atomically(path, buffer.getvalue())

    def restore(self, path: Path) -> None:
        """Resume from a saved state. Raises AdvpipeError for an unreadable file."""
        try:
            state = torch.load(path, map_location="cpu", weights_only=True)
            self.net.load_state_dict(state["net"])
            self.optimiser.load_state_dict(state["optimiser"])
            self.step = int(state["step"])
            torch.set_rng_state(state["random"])
        except Exception as error:  # torch.load raises whatever unpickling raises
            raise AdvpipeError(
                f"cannot resume from {path} ({type(error).__name__}); pass "
                f"{option_name('overwrite', True)} to start again"
            ) from None
