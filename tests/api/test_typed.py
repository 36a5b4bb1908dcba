"""What a type checker makes of a user's script: the true types, and an error for each mistake."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

SCRIPT = '''
from pathlib import Path

import numpy as np

import advpipe
from advpipe import Budget, LidarAttack, LidarResult, LidarTraits


class Nothing(LidarAttack):
    """Changes nothing."""

    traits = LidarTraits(budget=Budget(title="Nothing", parameter="amount", unit=""))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {"points_added": (0, 0)}

    def __call__(
        self,
        cloud: np.ndarray[tuple[int], np.dtype[np.void]],
        boxes: advpipe.Boxes,
        detector: advpipe.ObjectDetector,
        rng: np.random.Generator,
    ) -> LidarResult:
        return advpipe.unchanged(cloud, "as it was")


class Still:
    """Finds nothing."""

    classes = ("car",)
    range_m = advpipe.Range(-50, -50, -3, 50, 50, 1)

    def detect(self, cloud: object) -> int:
        return 0


drive = advpipe.simulate("smoke", settings={"simulation.duration_s": 1}, out=Path("here"))
detached = advpipe.attack(drive, type="detach", ratio=0.01)
report = advpipe.evaluate(drive, detached, detector=["small", "mine:Mine"])
reveal_type(advpipe.__version__)
reveal_type(drive.points)
reveal_type(detached.bag)
reveal_type(report.to_dicts())
reveal_type(advpipe.open_bag(drive).frame(0).boxes.geometry.shape)
reveal_type(advpipe.verify(drive).is_good)
advpipe.attack(drive, frames=5)
advpipe.simulate(3)
found: advpipe.ObjectDetector = Still()
'''


def test_a_script_of_a_user(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", str(script)]  # by the project's options, and so with its cache
    stated = subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout.splitlines()
    lines = SCRIPT.splitlines()
    revealed = [line.partition('type is "')[2].rstrip('"') for line in stated if "Revealed type" in line]
    assert [kind.replace("builtins.", "") for kind in revealed] == [
        "str",
        "int",
        "pathlib.Path",
        "list[dict[str, object]]",
        "tuple[Any, ...]",
        "bool",
    ]
    wrong = [lines[int(line.split(":")[1]) - 1] for line in stated if ": error:" in line]
    assert wrong == lines[-3:]
