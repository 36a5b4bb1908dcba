"""--device of every command that has one: a bad one is refused in a line, and nothing is left behind."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import torch

sys.path.insert(0, str(Path(__file__).parent))

from sweep_drive import DETECTOR, write_drive

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.cli.attack import attack_command
from advpipe.pipeline.cli.evaluate import evaluate_command
from advpipe.pipeline.cli.run import run
from advpipe.pipeline.cli.sweep import sweep_command
from advpipe.pipeline.cli.train import train_command
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.provenance import job_provenance
from advpipe.stages.attack.run import AttackRequest

COMMANDS = {
    "train": lambda bag, out, device: train_command([bag], out, device=device),
    "attack": lambda bag, out, device: attack_command(bag, detector=DETECTOR, out=out, device=device),
    "evaluate": lambda bag, out, device: evaluate_command([bag], [DETECTOR], out=out, device=device),
    "sweep": lambda bag, out, device: sweep_command(bag, detector=DETECTOR, out=out, device=device),
    "run": lambda bag, out, device: run("coordinated", out, device=device),
}


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("drive") / "clean")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_bad_device_is_refused(
    command: str, clean: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    for device, message in (("tpu", "unknown device 'tpu'; known: cpu"), ("cuda:1", "finds no CUDA GPU")):
        with pytest.raises(AdvpipeError, match=message):
            COMMANDS[command](clean, tmp_path / "out", device)
    assert list(tmp_path.iterdir()) == []


def test_an_attack_records_its_device_unless_it_is_the_cpu(clean: Path) -> None:
    def recorded(device: str) -> str | None:
        spec = AttackSpec(type="detach", parameters={"ratio": 0.01}, detector=DETECTOR)
        return job_provenance(BagReader(clean), AttackRequest((spec,), 0, device)).get("device")

    assert [recorded(device) for device in ("cpu", "cuda", "cuda:1")] == [None, "cuda", "cuda"]
