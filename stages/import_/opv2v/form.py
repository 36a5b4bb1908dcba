"""OPV2V's form, which V2XSet and other data sets of OpenCDA share."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from advpipe.pipeline.core.errors import UsageError
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.named_files import chosen_drive
from advpipe.stages.import_.options import ImportOptions
from advpipe.stages.import_.opv2v.scenario import Agent, Opv2vScenario

_NUMBER = re.compile(r"-?\d+", re.ASCII)
_TRUCKS = (
    "vehicle.carlamotors.carlacola",
    "vehicle.carlamotors.european_hgv",
    "vehicle.carlamotors.firetruck",
    "vehicle.ford.ambulance",
    "vehicle.mercedes.sprinter",
    "vehicle.mitsubishi.fusorosa",
    "vehicle.volkswagen.t2",
    "vehicle.volkswagen.t2_2021",
)
_CYCLES = (
    "vehicle.bh.crossbike",
    "vehicle.diamondback.century",
    "vehicle.gazelle.omafiets",
    "vehicle.harley-davidson.low_rider",
    "vehicle.kawasaki.ninja",
    "vehicle.vespa.zx125",
    "vehicle.yamaha.yzf",
)


class Opv2vForm(DriveForm):
    """Scenarios, each a folder of agents' folders with a PCD and a YAML file an instant.

    The agent that OpenCOOD takes for ego is `ego`, others are `cav_<number>`, and roadside units, whose
    numbers are negative, `rsu_<number>`. A vehicle is a car unless its `obj_type`
    or CARLA's blueprint (`bp_id`) says otherwise.
    """

    title = "OPV2V: scenarios of OpenCDA"
    citation = "Xu et al., OPV2V: An Open Benchmark Dataset and Fusion Pipeline, ICRA 2022"
    takes = ("drive", "interval_s", "classes")
    classes: ClassVar[Mapping[str, str]] = {
        "vehicle": "car",
        "Car": "car",
        "Truck": "truck",
        "Van": "truck",
        "Bus": "truck",
        "Cyclist": "cyclist",
        "Pedestrian": "pedestrian",
        **dict.fromkeys(_TRUCKS, "truck"),
        **dict.fromkeys(_CYCLES, "cyclist"),
    }

    def open(self, source: Path, options: ImportOptions) -> Opv2vScenario:
        """Open a scenario, or one of a folder's. Raises UsageError for a folder of another form."""
        if not source.is_dir():
            raise UsageError(f"{source} is not a folder; give a scenario of OPV2V, or a folder of scenarios")
        folder = source
        if not _agent_folders(source):
            folders = sorted(path for path in source.iterdir() if path.is_dir())
            names = [path.name for path in folders if _agent_folders(path)]
            if not names:
                raise UsageError(
                    f"{source} is no scenario of OPV2V and holds none: a scenario has folders of agents, "
                    "named by numbers, with files such as 000068.yaml and 000068.pcd"
                )
            folder = source / chosen_drive(source, "scenario", names, options.drive)
        class_map = self.class_map(options)
        return Opv2vScenario(
            folder.resolve().name, _agents(folder), class_map, class_map["vehicle"], options.interval_s
        )


def _agent_folders(scenario: Path) -> list[Path]:
    """As OpenCOOD sorts them: by name, with roadside units last."""
    found = [path for path in scenario.iterdir() if path.is_dir() and _NUMBER.fullmatch(path.name)]
    return sorted(found, key=lambda path: (path.name.startswith("-"), path.name))


def _agents(scenario: Path) -> list[Agent]:
    agents: list[Agent] = []
    for folder in _agent_folders(scenario):
        labelled, clouds = (
            {path.stem for path in folder.glob(pattern) if _NUMBER.fullmatch(path.stem)}
            for pattern in ("*.yaml", "*.pcd")
        )
        for tick in sorted(clouds - labelled):
            raise UsageError(f"{folder / tick}.yaml is missing, though there is {tick}.pcd")
        for tick in sorted(labelled - clouds):
            raise UsageError(f"{folder / tick}.pcd is missing, though {tick}.yaml labels it")
        if not labelled:
            raise UsageError(f"{folder} holds no frame (such as 000068.yaml and 000068.pcd)")
        prefix = "rsu" if folder.name.startswith("-") else "cav"
        name = "ego" if not agents else f"{prefix}_{folder.name.lstrip('-')}"
        agents.append(Agent(folder.name, name, folder, frozenset(labelled)))
    return agents
