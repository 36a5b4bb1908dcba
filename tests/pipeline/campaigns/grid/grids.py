"""Small grids, and finished cells with figures that are clear beforehand."""

from pathlib import Path

import yaml

from advpipe.pipeline.campaigns.grid.cell import GridOrigin, GridValues, ScoredCell, StoredGridCell
from advpipe.pipeline.campaigns.grid.load import LoadedGrid, load_grid
from advpipe.pipeline.campaigns.grid.run import Grid
from advpipe.pipeline.campaigns.grid.store import GridStore

DETACH = {"type": "detach", "recipe": "random", "parameters": {"ratio": 0.05}}


def write_grid_file(folder: Path, **keys: object) -> Path:
    """A grid of short smoke drives with one attack; keys: set, or left out where None."""
    given = {
        "name": "few",
        "scenario": "smoke",
        "settings": {"simulation.duration_s": 0.1},
        "attacks": {"detach": DETACH},
        "baseline_tries": 1,
        **keys,
    }
    path = folder / "grid.yaml"
    path.write_text(
        yaml.safe_dump({key: value for key, value in given.items() if value is not None}, sort_keys=False)
    )
    return path


def finished(path: Path, out: Path) -> tuple[LoadedGrid, list[ScoredCell]]:
    """Cells of a grid: under attack the mAP is (seed + 1) / 10 of 0.8, and half of that for defended ones."""
    loaded = load_grid(path)
    grid = Grid(loaded, GridStore(out), {}, "cpu", 1, keep_bags=False, overwrite=False)
    cells = []
    for drive in loaded.drives:
        for cell in grid.cells(drive):
            part = 0.8 * (drive.seed + 1) / 10 / (1 if cell.defence == "none" else 2)
            values = GridValues(
                stratum="all", objects=60, frames=1, map_clean=0.8, map_adv=part, map_baseline=0.6
            )
            near = GridValues(stratum="0-30 m", objects=40, frames=1, map_clean=0.9, map_adv=0.45)
            origin = GridOrigin(
                advpipe="0.1",
                code_sha256="c" * 64,
                commit="f" * 40,
                clean_sha256="a" * 64,
                bag_sha256="b" * 64,
                detector_sha256="d" * 64,
                attacked_against="small",
                is_white_box=True,
            )
            strata = (values, near) if cell.defence == "none" else (values,)
            identity = cell.identity(loaded.file, {"small": "d" * 64}, "cpu")
            cells.append(ScoredCell(cell, StoredGridCell(identity=identity, origin=origin, values=strata)))
    return loaded, cells
