"""Audits our own attacks: whether anything but the attack itself tells what each of them touched.

    python benchmarks/audit.py [--drives 3] [--seconds 20] [--attacks cam-dos gnss-bias] [--recipe random]
                               [--keep FOLDER]

Simulates drives on the boulevard with a small LiDAR, a radar and a small camera, attacks each with every
attack of the catalogue, and audits them, each drive by what the others taught. Prints, for each attack, the
probe that its definition does not move with the largest area, and all findings; exit code 1 if there is one.
With --drives 1, probes learn nothing and both directions are tried.

About 2 minutes of one core a drive with the recipe random and 20 s, half of it the LiDAR attacks, and more
with those on cameras; `best` takes ten times as long for those on LiDARs. --keep: the folder for the data
sets; what is there already is used again.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from common import machine

from advpipe.pipeline.audit.run import audit
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.camera.registry import CAMERA_ATTACKS
from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS
from advpipe.stages.attack.radar.registry import RADAR_ATTACKS
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS
from advpipe.stages.simulate.run import simulate

OVERRIDES = (
    *("simulation.warmup_s=5", "traffic.vehicles=40", "traffic.pedestrians=3"),
    *("sensors.lidars.lidar.channels=12", "sensors.lidars.lidar.points_per_second=43200"),
    "sensors.lidars.lidar.coordinate_grid_m=0.001953125",
    *("v2x.cpm={}", "sensors.radars={front: {preset: long-range}}"),
    "sensors.cameras={camera: {preset: front, image_size_x: 160, image_size_y: 90,"
    " images: [rgb, depth, instance_segmentation]}}",
)
SCHEDULE = {"from_s": 4.0, "to_s": 9.0}
"""Of cameras, whose attacks touch every image of their time."""
CAMERA = {"camera-patch": {"pattern": "random"}}
LIDAR = {"attach": {"eps_m": 0.5, "points": 30}, "perturb": {"eps_cm": 5.0}, "detach": {"ratio": 0.02}}


def requests(names: list[str], recipe: str) -> dict[str, dict[str, object]]:
    """Every attack that CAMs, CPMs, fixes, clouds, images and radar scans can have, by name."""
    found: dict[str, dict[str, object]] = {
        name: {"type": name, "recipe": recipe, "parameters": parameters, "frames": "::10"}
        for name, parameters in LIDAR.items()
    }
    found |= {name: {"type": name, "victim": "ego"} for name in GNSS_ATTACKS}
    found |= {name: {"type": name, "victim": "ego"} for name in RADAR_ATTACKS}
    found |= {
        name: {"type": name, "victim": "ego", "parameters": CAMERA.get(name, {}), "schedule": SCHEDULE}
        for name in CAMERA_ATTACKS
    }
    found |= {
        name: {"type": name, "attackers": {"share": 0.2}}
        for name in V2X_ATTACKS
        if name.startswith(("cam-", "cpm-"))
    }
    return {name: options for name, options in found.items() if not names or name in names}


def make(folder: Path, seed: int, seconds: float, wanted: dict[str, dict[str, object]]) -> Path:
    """A drive with its attacks; those that are there already stay."""
    if not (folder / "clean").is_dir():
        keys = (*OVERRIDES, f"simulation.seed={seed}", f"simulation.duration_s={seconds}")
        simulate(load_scenario("boulevard", keys), folder)
    for name, options in wanted.items():
        if (folder / name).is_dir():
            continue
        try:
            attack(folder / "clean", folder / name, AttackRequest((attack_spec(options),)), workers=1)
        except AdvpipeError as error:
            print(f"{folder.name}: {name} is left out: {error}", flush=True)
    return folder


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--drives", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--attacks", nargs="*", default=[])
    parser.add_argument("--recipe", default="random")
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    print(machine())
    wanted = requests(options.attacks, options.recipe)
    with tempfile.TemporaryDirectory() as scratch:
        root = options.keep or Path(scratch)
        root.mkdir(parents=True, exist_ok=True)
        begin = time.process_time()
        drives = [
            make(root / f"drive{seed}", seed, options.seconds, wanted)
            for seed in range(1, 1 + options.drives)
        ]
        made_s, begin = time.process_time() - begin, time.process_time()
        result = audit(drives)
        audited_s = time.process_time() - begin
    for name in dict.fromkeys(each.attack for each in result.results):
        print(f"strongest: {result.strongest(name)}")
    for finding in result.findings:
        print(f"FINDING: {finding}")
    bags = len(drives) * (1 + len(wanted))
    print(
        f"{result}; {made_s:.0f} processor-s to make, {audited_s:.0f} to audit ({audited_s / bags:.1f} a bag)"
    )
    return 0 if result.is_good else 1


if __name__ == "__main__":
    raise SystemExit(main())
