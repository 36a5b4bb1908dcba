"""The results of a grid: one Parquet file, and a page that needs no other file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from advpipe.pipeline.campaigns.grid.cell import WHOLE, GridOrigin, GridValues, ScoredCell
from advpipe.pipeline.campaigns.grid.message_tables import message_tables
from advpipe.pipeline.campaigns.grid.models import GridFile
from advpipe.pipeline.campaigns.grid.pictures import grid_pictures
from advpipe.pipeline.campaigns.grid.score import RANGES
from advpipe.pipeline.campaigns.grid.statistics import LEAST_DRIVES, GridGroup, groups_of_cells
from advpipe.pipeline.campaigns.sweep.document import TEMPLATE
from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.html_page import rendered
from advpipe.pipeline.core.section import leaves
from advpipe.pipeline.core.text import counted
from advpipe.stages.evaluate.report.numbers import formatted_number, with_interval
from advpipe.stages.evaluate.report.report import FORMULAS
from advpipe.stages.evaluate.report.section import Table

_SHOWN = ("ap", "map", "map_ratio", "iou", "ignored", "chamfer", "baseline", "white_box")


def write_grid(
    folder: Path, grid: GridFile, cells: Sequence[ScoredCell], warnings: Sequence[str] = ()
) -> None:
    """Write grid.parquet, report.html and figures/; those of an earlier run are replaced."""
    sink = BytesIO()
    pq.write_table(grid_table(grid, cells), sink)
    write_atomically(folder / "grid.parquet", sink.getvalue())
    groups = groups_of_cells(cells)
    of_clouds = [group for group in groups if group.key[2]]
    pictures = grid_pictures(grid, of_clouds) if of_clouds else []
    (folder / "figures").mkdir(exist_ok=True)
    for picture in pictures:
        for name, content in picture.files.items():
            write_atomically(folder / "figures" / name, content)
    title = f"Grid {grid.name}"
    page = rendered(
        TEMPLATE.read_text(encoding="utf-8"),
        title=title,
        warnings=warnings,
        caveats=grid_caveats(grid),
        tables=[*([ratio_table(grid, of_clouds)] if of_clouds else []), *message_tables(grid, groups)],
        details=[range_table(grid, of_clouds)] if of_clouds else [],
        pictures=pictures,
        formulas={key: FORMULAS[key] for key in _SHOWN},
        command=json.dumps(grid.model_dump(mode="json", exclude_defaults=True), indent=1),
        provenance=json.dumps(grid_provenance(grid, cells), indent=1, sort_keys=True),
    )
    write_atomically(folder / "report.html", page.encode())


def grid_table(grid: GridFile, cells: Sequence[ScoredCell]) -> pa.Table:
    """A row for each cell and stratum; a factor's column holds numbers if all its levels are numbers."""
    rows = [row for cell in cells for row in cell.rows(grid.name)]
    columns: dict[str, pa.DataType] = {"grid": pa.string()}
    for factor in grid.factors:
        is_number = all(isinstance(label, int | float) for label, _ in grid.levels(factor))
        columns[factor] = pa.float64() if is_number else pa.string()
        for row in rows:
            row[factor] = float(row[factor]) if is_number else str(row[factor])
    columns |= {"seed": pa.int64(), **dict.fromkeys(("drive", "attack", "detector", "defence"), pa.string())}
    for model in (GridValues, GridOrigin):
        columns |= {name: _arrow(field.annotation) for name, field in model.model_fields.items()}
    schema = pa.schema(list(columns.items()))
    return pa.Table.from_pylist(rows, schema=schema)


def _arrow(annotation: Any) -> pa.DataType:
    (kind,) = leaves(annotation)
    return {bool: pa.bool_(), float: pa.float64(), int: pa.int64(), str: pa.string()}[kind]


def grid_caveats(grid: GridFile) -> list[str]:
    """What a reader must know to interpret the figures."""
    drives = counted(len(grid.seeds), "drive")
    few = (
        f"Fewer than {LEAST_DRIVES} seeds: there is no interval over drives. "
        if len(grid.seeds) < LEAST_DRIVES
        else ""
    )
    return [
        f"{few}Each figure is the ratio of the mean mAP under attack to the mean mAP on clean clouds, over "
        f"{drives} with the seeds {', '.join(map(str, grid.seeds))}. Intervals of 95 % are over drives: "
        "whole drives are drawn with replacement (expanded percentile bootstrap), not frames of a drive. "
        "There is none where draws of drives in which hardly anything is found on clean clouds are too many.",
        "Levels are compared on drives of the same seeds; what differs between two levels beside the factor "
        "depends on the scenario: other traffic is another drive, other weather is the same traffic.",
    ]


def ratio_table(grid: GridFile, groups: Sequence[GridGroup]) -> Table:
    """A line for each level of each factor, attack, detector and defence, over all seeds."""
    lines = []
    for group in groups:
        levels, attack, detector, defence = group.key
        ratio, random, delta = group.ratio(), group.ratio(of_baseline=True), group.delta()
        lines.append(
            (
                *map(str, levels),
                *(attack, Path(detector).name, defence, str(len(group.seeds))),
                formatted_number(group.map_clean(), 3),
                with_interval(ratio.percent, ratio.ci95),
                with_interval(random.percent, random.ci95),
                with_interval(delta.percent, delta.ci95),
            )
        )
    heads = (
        *grid.factors,
        *("attack", "detector", "defence", "drives", "clean mAP", "mAP ratio %", "random baseline %"),
        "Δ to baseline, points",
    )
    return Table("mAP ratio over drives", heads, tuple(lines))


def range_table(grid: GridFile, groups: Sequence[GridGroup]) -> Table:
    """The mAP ratio of objects in each range of distances, without a defence."""
    lines = []
    for group in groups:
        levels, attack, detector, _ = group.key
        ratios = [group.ratio(stratum) for stratum in (WHOLE, *RANGES)]
        if any(each.percent == each.percent for each in ratios[1:]):
            texts = [with_interval(each.percent, each.ci95) for each in ratios]
            lines.append((*map(str, levels), attack, Path(detector).name, *texts))
    heads = (*grid.factors, "attack", "detector", "all objects", *RANGES)
    return Table("mAP ratio by range, in percent", heads, tuple(lines))


def grid_provenance(grid: GridFile, cells: Sequence[ScoredCell]) -> dict[str, Any]:
    """What made the cells: seeds, commits, versions, and the checksums of drives and detectors."""
    origins = [each.stored.origin for each in cells]
    return {
        "grid": grid.name,
        "seeds": list(grid.seeds),
        "commits": sorted({origin.commit for origin in origins if origin.commit}),
        "advpipe": sorted({origin.advpipe for origin in origins}),
        "code_sha256": sorted({origin.code_sha256 for origin in origins}),
        "detectors_sha256": {
            each.cell.detector: each.stored.origin.detector_sha256 for each in cells if each.cell.detector
        },
        "drives": {
            each.cell.drive.id: {
                "levels": dict(each.cell.drive.levels),
                "seed": each.cell.drive.seed,
                "clean_sha256": each.stored.origin.clean_sha256,
            }
            for each in cells
        },
    }


def print_grid(grid: GridFile, cells: Sequence[ScoredCell], warnings: Sequence[str] = ()) -> None:
    """The table over drives on the terminal; of its columns those that fit there."""
    from advpipe.pipeline.campaigns.sweep.document import rich_table
    from advpipe.pipeline.core.streams import plain_console

    console = plain_console()
    for warning in warnings:
        console.print(warning, style="bold yellow", highlight=False, markup=False)
    groups = groups_of_cells(cells)
    if of_clouds := [group for group in groups if group.key[2]]:
        console.print(rich_table(_for_terminal(ratio_table(grid, of_clouds))))
    for table in message_tables(grid, groups):
        console.print(rich_table(table))
    for caveat in grid_caveats(grid):
        console.print(caveat, highlight=False, markup=False)


def _for_terminal(table: Table) -> Table:
    """The names that differ between lines, and the mAP on clean clouds and its ratio under attack."""
    ratio = table.heads.index("mAP ratio %")
    names = [place for place in range(ratio - 1) if len({line[place] for line in table.lines}) > 1]
    shown = [*names, ratio - 1, ratio]
    lines = tuple(tuple(line[place] for place in shown) for line in table.lines)
    return Table(table.title, tuple(table.heads[place] for place in shown), lines)
