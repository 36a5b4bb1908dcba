"""Where a run stands: enough to go on as if it had never stopped."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass
from pathlib import Path

import torch

from advpipe.pipeline.detector.second.model import SecondNet
from advpipe.pipeline.errors import AdvpipeError


@dataclass
class TrainState:
    """The network, the optimiser and the next step."""

    net: SecondNet
    optimiser: torch.optim.AdamW
    step: int = 0

    @classmethod
    def new(cls, net: SecondNet, learning_rate: float, weight_decay: float) -> TrainState:
        optimiser = torch.optim.AdamW(
            net.parameters(), learning_rate, betas=(0.9, 0.99), weight_decay=weight_decay
        )
        return cls(net, optimiser)

    def save(self, path: Path) -> None:
        """Write beside, then rename."""
        beside = path.with_name(f".{path.name}.part")
        state = {
            "step": self.step,
            "net": self.net.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "random": torch.get_rng_state(),
        }
        buffer = io.BytesIO()
        torch.save(state, buffer)  # to a file, it hides why a disk refused to be written
        beside.write_bytes(buffer.getbuffer())
        os.replace(beside, path)

    def restore(self, path: Path) -> None:
        """Go on from a saved state."""
        try:
            state = torch.load(path, map_location="cpu", weights_only=True)
            self.net.load_state_dict(state["net"])
            self.optimiser.load_state_dict(state["optimiser"])
            self.step = int(state["step"])
            torch.set_rng_state(state["random"])
        except Exception as error:  # torch.load raises whatever unpickling raises
            raise AdvpipeError(
                f"cannot go on from {path} ({type(error).__name__}); pass --overwrite to start again"
            ) from None
