"""The fuzzer itself: it finds every type of fault, continues after each, and reproduces it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.findings import ABOUT, Finding, all_of
from tests.fuzz.targets.planted import FAULTS, FILE
from tests.fuzz.watch import Limits, Watch
from tests.fuzz.worker import Folder

ROOT = Path(__file__).parents[2]
SEED, INPUTS = 24, 60  # which draw every fault, and few that take their time
TIGHT = Limits(hang_s=4.0, memory_bytes=700 << 20)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where a run keeps its things; of the documents, the planted target needs a folder alone."""
    out = tmp_path_factory.mktemp("fuzz")
    (out / "base" / "tables").mkdir(parents=True)
    (out / "base" / "whole").touch()
    return out


def watch(out: Path, **options: object) -> Watch:
    folder = Folder(out / "work" / "planted")
    folder.path.mkdir(parents=True, exist_ok=True)
    return Watch("planted", folder=folder, limits=TIGHT, **options)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def found(out: Path) -> dict[str, Finding]:
    """What a run over the planted faults finds, by the call."""
    progress = watch(out, engine="hypothesis", seed=SEED, inputs=INPUTS).run()
    assert progress.inputs == INPUTS
    return {finding.case.call: finding for finding in all_of(out / "findings")}


def test_every_planted_fault_is_found_and_nothing_else(found: dict[str, Finding]) -> None:
    assert {call: finding.fault.kind for call, finding in found.items()} == FAULTS


def test_a_finding_names_its_target_and_place(found: dict[str, Finding]) -> None:
    assert found["raises"].fault.what == "KeyError: 'planted'"
    assert found["raises"].fault.where.startswith("pipeline/core/text.py:")
    assert "planted.py" in found["raises"].fault.trace
    assert "_grow" in found["grows"].fault.trace  # of a worker that had to be stopped, too
    assert found["aborts"].fault.what == "ended by SIGABRT"


@pytest.mark.parametrize("call", ["raises", "aborts"])
def test_a_recorded_finding_is_reproduced(out: Path, found: dict[str, Finding], call: str) -> None:
    done = replayed(out, found[call].folder / FILE)
    assert done.returncode == 1, done.stderr
    assert f"{FAULTS[call]} in {call}" in done.stdout
    assert done.stdout.endswith("not handled\n")


def test_a_fixed_finding_is_handled(out: Path, found: dict[str, Finding]) -> None:
    folder = found["raises"].folder
    about = json.loads((folder / ABOUT).read_text())
    (folder / ABOUT).write_text(json.dumps(about | {"call": "refuses"}))
    done = replayed(out, folder)
    (folder / ABOUT).write_text(json.dumps(about))
    assert (done.returncode, done.stdout) == (0, "handled\n")


def replayed(out: Path, path: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tests.fuzz", "--out", str(out), "--replay", str(path)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def test_the_same_seed_draws_the_same_inputs(tmp_path: Path) -> None:
    from tests.fuzz.engines import Enough, explore
    from tests.fuzz.targets.planted import cases

    def drawn(seed: int) -> list[object]:
        kept: list[object] = []

        def keep(case: object) -> None:
            if len(kept) == 250:  # more than a batch
                raise Enough
            kept.append(case)

        with pytest.raises(Enough):
            explore(cases(tmp_path), keep, seed, 0, lambda batch: None)
        return kept

    assert drawn(1) == drawn(1) != drawn(2)


def test_atheris_measures_coverage(tmp_path: Path) -> None:
    pytest.importorskip("atheris")
    (tmp_path / "base" / "tables").mkdir(parents=True)
    run = watch(tmp_path, engine="atheris", seed=0, inputs=250)
    assert run.run().inputs >= 250
    assert run.edges > 5
