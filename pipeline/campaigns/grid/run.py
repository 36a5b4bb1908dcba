"""A grid of experiments: its missing cells are run, drive after drive, and all of them are reported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.grid.cell import GridCell, GridOrigin, ScoredCell, StoredGridCell
from advpipe.pipeline.campaigns.grid.document import print_grid, write_grid
from advpipe.pipeline.campaigns.grid.load import GridDrive, LoadedGrid, load_grid
from advpipe.pipeline.campaigns.grid.messages import MESSAGE_CODE, leaves_clouds, score_messages
from advpipe.pipeline.campaigns.grid.models import UNDEFENDED
from advpipe.pipeline.campaigns.grid.score import score_bag
from advpipe.pipeline.campaigns.grid.store import GridStore, other_drive
from advpipe.pipeline.campaigns.run import has_drive, is_made_by
from advpipe.pipeline.campaigns.sweep.settings import CODE
from advpipe.pipeline.core.code import code_sha256, source_commit
from advpipe.pipeline.core.errors import AdvpipeError, UsageError, as_usage_error, writing
from advpipe.pipeline.core.partial import remove_output
from advpipe.pipeline.core.progress import plan_progress, working_on
from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.core.verbosity import print_result
from advpipe.pipeline.core.versions import installed
from advpipe.pipeline.detector.attacked import attacked_sha256
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.process.folder import working_path
from advpipe.stages.attack.registry import find_attack
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.training_map import map_status
from advpipe.stages.simulate.run import simulate

WRITING_GRID = "writing the page"


@dataclass(frozen=True)
class Grid:
    """A loaded grid and its folder, which keeps the drives and the finished cells.

    sha256_of: by detector, those that are attacked among them.
    """

    loaded: LoadedGrid
    store: GridStore
    sha256_of: Mapping[str, str]
    device: str
    workers: int | None
    keep_bags: bool
    overwrite: bool

    @classmethod
    def prepared(
        cls,
        path: Path,
        out: Path | None,
        *,
        device: str,
        workers: int | None,
        keep_bags: bool,
        overwrite: bool,
    ) -> Grid:
        """Load the grid; by default its folder is `grids/<name>`.

        Raises AdvpipeError for all that can be refused before hours of work.
        """
        loaded = load_grid(path)
        with as_usage_error():
            for detector in loaded.file.detectors:
                Options(detectors=(detector,), device=device)
                load_detector(detector, device)
            for name, specs in loaded.file.attacks.items():
                request = AttackRequest(specs, loaded.drives[0].seed, device)
                request.check()
                for drive in loaded.drives:
                    request.refuse_without_v2x(name, drive.scenario)
        folder = working_path("grids") / loaded.file.name if out is None else out
        attacked = [spec.detector for specs in loaded.file.attacks.values() for spec in specs]
        sha256_of = {name: attacked_sha256(name) for name in (*loaded.file.detectors, *attacked)}
        return cls(loaded, GridStore(folder), sha256_of, device, workers, keep_bags, overwrite)

    def cells(self, drive: GridDrive) -> list[GridCell]:
        """The cells of a drive."""
        grid = self.loaded.file
        cells = []
        for name, specs in grid.attacks.items():
            if leaves_clouds(specs):
                cells.append(GridCell(drive, name, "", UNDEFENDED))
                continue
            for detector, defence in product(grid.detectors, grid.defences):
                cells.append(GridCell(drive, name, detector, defence))
        return cells

    def run(self) -> GridReport:
        """Run the missing cells, and write grid.parquet and report.html of all."""
        self.store.open()
        missing = {
            drive.id: [cell for cell in self.cells(drive) if self._stored(cell) is None]
            for drive in self.loaded.drives
        }
        count = sum(map(len, missing.values()))
        total = sum(len(self.cells(drive)) for drive in self.loaded.drives)
        print_result(f"{counted(total, 'cell')} of {counted(len(missing), 'drive')}: {total - count} kept")
        plan_progress({**{name: 10.0 for name, cells in missing.items() if cells}, WRITING_GRID: 1})
        for drive in self.loaded.drives:
            if cells := missing[drive.id]:
                with working_on(drive.id):
                    self._run_drive(drive, cells)
        with working_on(WRITING_GRID):
            return self._write()

    def _run_drive(self, drive: GridDrive, missing: Sequence[GridCell]) -> None:
        data_set = self.store.folder / "drives" / drive.id
        attacks = list(dict.fromkeys(cell.attack for cell in missing))
        plan_progress({"simulating": 2, **dict.fromkeys(attacks, 5)})
        with working_on("simulating"), _errors_naming(drive.title):
            if not has_drive(data_set, drive.scenario, overwrite=False):
                simulate(drive.scenario, data_set)
            clean_sha256 = parent_sha256(data_set / "clean")
        missing = [*missing, *self._of_another_drive(drive, clean_sha256, data_set)]
        for name in dict.fromkeys(cell.attack for cell in missing):
            with working_on(name):
                with _errors_naming(f"{drive.title}, {name}"):
                    bag = self._attack(drive, name, data_set)
                for detector in ("", *self.loaded.file.detectors):
                    cells = [each for each in missing if (each.attack, each.detector) == (name, detector)]
                    if cells:
                        with _errors_naming(_title(cells)):
                            self._score(data_set / "clean", bag, cells, clean_sha256)
                if not self.keep_bags:
                    remove_output(bag)

    def _of_another_drive(self, drive: GridDrive, clean_sha256: str, data_set: Path) -> list[GridCell]:
        """The finished cells that were made of a drive with other bytes, to be computed again.

        Raises UsageError for one, unless `overwrite`.
        """
        found = []
        for cell in self.cells(drive):
            kept = self._stored(cell)
            if kept is not None and kept.origin.clean_sha256 != clean_sha256:
                if not self.overwrite:
                    raise other_drive(kept.origin, clean_sha256, data_set)
                found.append(cell)
        return found

    def _attack(self, drive: GridDrive, name: str, data_set: Path) -> Path:
        """Make the adversarial bag of an attack, unless a stopped run has made it."""
        grid, clean, bag = self.loaded.file, data_set / "clean", data_set / name
        specs = tuple(
            spec.model_copy(update={"frames": grid.frames, "lidar": spec.lidar or grid.lidar})
            if find_attack(spec.type).family == "lidar"
            else spec
            for spec in grid.attacks[name]
        )
        request = AttackRequest(specs, drive.seed, self.device, debug=False)
        if not is_made_by(request, clean, bag, overwrite=True):
            with writing(bag):
                attack(clean, bag, request, overwrite=bag.exists(), workers=self.workers)
        return bag

    def _score(self, clean: Path, bag: Path, cells: Sequence[GridCell], clean_sha256: str) -> None:
        """Score a bag as one detector sees it, under each defence, and store the cells."""
        grid, (first, *_) = self.loaded.file, cells
        if not first.detector:
            self._score_messages(clean, bag, first, clean_sha256)
            return
        scored = score_bag(
            clean,
            bag,
            first.detector,
            [cell.defence for cell in cells],
            grid,
            first.drive.seed,
            device=self.device,
            workers=self.workers,
        )
        made = scored.row.attack
        origin = self._origin(first, bag, clean_sha256, made.attacked_against, made.is_white_box)
        for cell in cells:
            values = scored.values[cell.defence]
            identity = self._identity(cell)
            self.store.save(StoredGridCell(identity=identity, origin=origin, values=values))
            under = "" if cell.defence == UNDEFENDED else f" under {cell.defence}"
            clean_map, map_adv = values[0].map_clean, values[0].map_adv
            print_result(
                f"{cell.drive.id}, {cell.attack}, {cell.detector}{under}: mAP {clean_map} -> {map_adv}"
            )

    def _score_messages(self, clean: Path, bag: Path, cell: GridCell, clean_sha256: str) -> None:
        """Score a bag of attacked fixes or messages, and store its cell."""
        values = score_messages(clean, bag, cell.drive.seed)
        origin = self._origin(cell, bag, clean_sha256, None, None)
        self.store.save(StoredGridCell(identity=self._identity(cell), origin=origin, values=values))
        scored = ", ".join(each.stratum for each in values)
        print_result(f"{cell.drive.id}, {cell.attack}: {scored}")

    def _origin(
        self, cell: GridCell, bag: Path, clean_sha256: str, against: str | None, is_white_box: bool | None
    ) -> GridOrigin:
        return GridOrigin(
            advpipe=installed("advpipe"),
            code_sha256=_code_of(cell),
            commit=source_commit(),
            clean_sha256=clean_sha256,
            bag_sha256=parent_sha256(bag),
            detector_sha256=self.sha256_of.get(cell.detector, ""),
            attacked_against=against,
            is_white_box=is_white_box,
        )

    def _identity(self, cell: GridCell) -> dict[str, object]:
        return cell.identity(self.loaded.file, self.sha256_of, self.device)

    def _stored(self, cell: GridCell) -> StoredGridCell | None:
        return self.store.load(self._identity(cell), _code_of(cell), self.overwrite)

    def _scored(self) -> Iterator[ScoredCell]:
        for drive in self.loaded.drives:
            for cell in self.cells(drive):
                stored = self._stored(cell)
                assert stored is not None
                yield ScoredCell(cell, stored)

    def _write(self) -> GridReport:
        found = tuple(self._scored())
        warnings = dict.fromkeys(
            status.text
            for detector in self.loaded.file.detectors
            for drive in self.loaded.drives
            if (clean := self.store.folder / "drives" / drive.id / "clean").is_dir()
            and (
                status := map_status(
                    detector, load_detector(detector, self.device), BagReader(clean).provenance
                )
            ).text
        )
        report = GridReport(self.store.folder, self.loaded, found, tuple(warnings))
        write_grid(self.store.folder, self.loaded.file, found, report.warnings)
        return report


@contextmanager
def _errors_naming(what: str) -> Iterator[None]:
    """Begin the line of an error in the block with the drive or cell that it is about: a grid has many."""
    try:
        yield
    except AdvpipeError as error:
        kind = UsageError if isinstance(error, UsageError) else AdvpipeError
        raise kind(f"{what}: {error}") from None


def _title(cells: Sequence[GridCell]) -> str:
    """The cells of one bag and detector, as errors name them; the defences if there is no cell without."""
    first, defences = cells[0], [cell.defence for cell in cells]
    detector = f", {first.detector}" if first.detector else ""
    under = "" if UNDEFENDED in defences else f" under {', '.join(defences)}"
    return f"{first.drive.title}, {first.attack}{detector}{under}"


def _code_of(cell: GridCell) -> str:
    """Identifies the code that decides the cell's figures."""
    return code_sha256(*(CODE if cell.detector else MESSAGE_CODE))


@dataclass(frozen=True, repr=False)
class GridReport(Tabular):
    """What a grid's folder holds now: grid.parquet, report.html and figures/; and all cells of the grid."""

    folder: Path
    loaded: LoadedGrid
    cells: tuple[ScoredCell, ...]
    warnings: tuple[str, ...]

    @property
    def page(self) -> Path:
        """The page with all tables and pictures."""
        return self.folder / "report.html"

    @property
    def table(self) -> Path:
        """The Parquet file with all rows."""
        return self.folder / "grid.parquet"

    def __str__(self) -> str:
        drives = counted(len(self.loaded.drives), "drive")
        return f"{self.folder}: {counted(len(self.cells), 'cell')} of {drives}"

    def to_dicts(self) -> Rows:
        """A row for each cell and stratum of objects, with the columns of grid.parquet."""
        return [row for cell in self.cells for row in cell.rows(self.loaded.file.name)]

    def show(self) -> None:
        """The table over seeds on the terminal."""
        print_grid(self.loaded.file, self.cells, self.warnings)
