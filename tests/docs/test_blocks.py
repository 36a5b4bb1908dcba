"""Every fenced block of README.md, CONTRIBUTING.md and docs/ works, or is marked as output.

`bash`: the real command line parses every `advpipe` command, and reads its scenario, its attack and its
parameters; the pages in RUN are also carried out from top to bottom. `python`: carried out, block by block.
`yaml`: loaded as a scenario, or as part of one. A block whose first line names a file is that file.
`text` is output, `mermaid` a drawing and `bibtex` a reference.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import blocks
import pytest
import typer
import yaml

from advpipe.commands.attackers import attackers_section
from advpipe.pipeline.cli import app
from advpipe.pipeline.cli.attack import _parameters
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.registry import default_budget
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.run import evaluate
from advpipe.stages.simulate.run import simulate

RUN = ("docs/tutorial.md", "docs/extending.md")
OTHER_PROGRAMS = {"apt-get", "dnf", "pacman", "pip", "python", "python3"}
COMMANDS = typer.main.get_command(app)


def test_every_block_says_what_it_is() -> None:
    """An unmarked block, or one in another language, would be run by nobody."""
    known = {"bash", "python", "yaml", "bibtex", "text", "mermaid"}
    strange = [blocks.where(block) for block in blocks.ALL if block.language not in known]
    assert not strange
    assert len(blocks.of("bash")) > 10
    assert len(blocks.of("python")) > 5


@pytest.mark.parametrize("block", blocks.of("bash"), ids=blocks.where)
def test_commands_exist(block: blocks.Block) -> None:
    """With their options; scenarios, attacks and parameters are read as the command reads them."""
    for words in block.commands:
        program, *rest = words
        if program.removeprefix(".venv/bin/") == "advpipe":
            parse(rest)
        elif program == "make":
            rules = (blocks.ROOT / "Makefile").read_text(encoding="utf-8")
            targets = [word for word in rest if "=" not in word]
            assert all(re.search(rf"^{target}:", rules, re.MULTILINE) for target in targets), words
        else:
            assert program.removeprefix(".venv/bin/") in OTHER_PROGRAMS, words


def parse(words: list[str]) -> None:
    """Raises what the command line would raise for these words."""
    name, *rest = words
    given = COMMANDS.commands[name].make_context(name, rest).params  # type: ignore[attr-defined]
    if name == "attack":
        check_attack(given)
    elif name in ("simulate", "run") and given["scenario"] in shipped():
        load_scenario(given["scenario"], [each for each in given["settings"] or () if ".xodr" not in each])


def shipped() -> set[str]:
    return {path.stem for path in (blocks.ROOT / "scenarios").glob("*.yaml")}


def check_attack(given: dict) -> None:
    """The attack as the command makes it of its options, but for a user's own class."""
    if ":" in given["type"]:
        return
    usual = default_budget(given["type"])
    own = {one.name for one in COMMANDS.commands["attack"].params}  # type: ignore[attr-defined]
    options = {name: value for name, value in given.items() if name not in own and value is not None}
    tree = {
        "type": given["type"],
        "recipe": given["recipe"],
        "parameters": {**usual, **_parameters(options, given["settings"] or [])},
        "attackers": attackers_section(given["attacker"] or []),
        "victim": given["victim"],
        "frames": given["frames"],
    }
    AttackRequest((attack_spec(tree),)).check()


@pytest.mark.parametrize("block", [one for one in blocks.of("yaml") if not one.file_name], ids=blocks.where)
def test_documents_load(block: blocks.Block, tmp_path: Path) -> None:
    """As a scenario; a part of one is put into the smallest scenario that there is. The pages in RUN use
    those that are files."""
    tree = yaml.safe_load(block.text)
    whole = {"name": "part", "map": {"generator": {"kind": "grid", "size": 3}}} | tree
    for name in ("my_town.net.xml", "poses.csv", "my_car.obj"):
        (tmp_path / name).write_text("")  # a file has to exist; what it holds, the drive reads
    (tmp_path / "scenario.yaml").write_text(yaml.safe_dump(whole), encoding="utf-8")
    scenario = load_scenario(str(tmp_path / "scenario.yaml"))
    for specs in scenario.attacks.values():
        AttackRequest(specs).check()


@pytest.fixture(scope="module")
def data_sets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `datasets/smoke`: a drive of three coarse clouds, and its report."""
    folder = tmp_path_factory.mktemp("blocks")
    coarse = ["simulation.duration_s=0.3", "sensors.lidars.lidar.points_per_second=72000"]
    smoke = folder / "datasets" / "smoke"
    simulate(load_scenario("smoke", [*coarse, "v2x.penetration=1"]), smoke)
    evaluate(smoke / "clean", [], smoke / "reports" / "small", Options(frames=FrameSlice(0, 1)), workers=1)
    return folder


@pytest.mark.parametrize("page", sorted({block.page for block in blocks.of("python")} | set(RUN)))
def test_pages_run(page: str, data_sets: Path, tmp_path: Path) -> None:
    """From top to bottom, in one folder: files are written, Python and the commands carried out."""
    shutil.copytree(data_sets / "datasets", tmp_path / "datasets")
    script = str(Path(__file__).with_name("carry_out.py"))
    command = [sys.executable, script, page, "run" if page in RUN else "python alone"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
