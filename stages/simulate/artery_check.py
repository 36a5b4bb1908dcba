"""Whether Artery with our module is there and works: a short drive of messages through it."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.artery.process import artery_program
from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.artery import Artery
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.stages.simulate.run import simulate

SCENARIO = "smoke"
DRIVE = (
    "v2x.network=artery",
    "vehicles={}",
    "sensors={}",
    "traffic.vehicles=20",
    "traffic.pedestrians=0",
    "simulation.warmup_s=3",
    "simulation.duration_s=5",
)


@dataclass(frozen=True)
class ArteryFinding:
    """One check: what was seen, and whether it is what advpipe relies on."""

    name: str
    is_good: bool
    seen: str

    def __str__(self) -> str:
        return f"{'ok  ' if self.is_good else 'FAIL'}  {self.name}: {self.seen}"


def check_artery(settings: Artery) -> list[ArteryFinding]:
    """The findings in order; one that fails is the last."""
    try:
        program = artery_program(settings)
    except AdvpipeError as error:
        return [ArteryFinding("program", False, one_line(error))]
    found = [ArteryFinding("program", True, program)]
    try:
        statistics = _drive(program, settings.timeout_s)
    except AdvpipeError as error:
        return [*found, ArteryFinding("lock-step", False, one_line(error))]
    steps = "50 steps of 0.1 s, at the same time in SUMO, Artery and the drive"
    found.append(ArteryFinding("lock-step", True, steps))
    sent = f"{counted(statistics.cams, 'CAM')} of {counted(statistics.stations, 'station')}"
    found.append(ArteryFinding("stations", statistics.cams > 0, sent))
    pairs, received = sum(statistics.pairs[:4]), sum(statistics.received[:4])
    share = f"{received} of {pairs} receptions up to 200 m"
    found.append(ArteryFinding("radio", received > pairs / 4, share))
    return found


def _drive(program: str, timeout_s: float) -> Statistics:
    settings = [*DRIVE, f"artery.program={program}", f"artery.timeout_s={timeout_s!r}"]
    with tempfile.TemporaryDirectory(prefix="advpipe-") as folder:
        drive = simulate(load_scenario(SCENARIO, settings), Path(folder) / "drive")
    assert drive.v2x is not None
    return drive.v2x
