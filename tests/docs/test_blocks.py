"""Every fenced block of the READMEs, CONTRIBUTING.md and docs/ works, or is marked as output.

`bash`: the real command line parses every `advpipe` command, and reads its scenario, its attack and its
parameters. `test_pages.py` carries out the pages in `blocks.RUN` from top to bottom, and the `python` of all.
`yaml`: loaded as a scenario, or as part of one. A block whose first line names a file is that file.
`text` is output, `mermaid` a drawing and `bibtex` a reference.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import blocks
import pytest
import typer
import yaml

from advpipe.commands.attackers import attackers_section
from advpipe.pipeline.campaigns.relay.settings import load_relay_settings
from advpipe.pipeline.cli import app
from advpipe.pipeline.cli.attack import given_parameters
from advpipe.pipeline.cli.simulate import DEFAULT
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.registry import default_budget
from advpipe.stages.attack.request import AttackRequest

BUILD = "pipeline/artery/build.sh"
OTHER_PROGRAMS = {BUILD, "export", "apt-get", "dnf", "pacman", "pip", "python", "python3"}
INTERNAL = ("pipeline", "stages", "commands")
"""Parts of `advpipe` that are not for users."""
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
    for arguments in block.commands:
        program, *rest = arguments
        if program.removeprefix(".venv/bin/") == "advpipe":
            parse(rest)
        elif program == "make":
            rules = (blocks.ROOT / "Makefile").read_text(encoding="utf-8")
            targets = [argument for argument in rest if "=" not in argument]
            assert all(re.search(rf"^{target}:", rules, re.MULTILINE) for target in targets), arguments
        else:
            assert program.removeprefix(".venv/bin/") in OTHER_PROGRAMS, arguments


def parse(arguments: list[str]) -> None:
    """Raises what the command line would raise for these words."""
    name, *rest = arguments
    given = COMMANDS.commands[name].make_context(name, rest).params  # type: ignore[attr-defined]
    if name == "attack":
        check_attack(given)
    elif name in ("simulate", "run"):
        names = given["scenarios"] or [DEFAULT] if name == "simulate" else [given["scenario"]]
        for scenario in shipped().intersection(names):
            load_scenario(scenario, [each for each in given["settings"] or () if ".xodr" not in each])


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
        "parameters": {**usual, **given_parameters(options, given["settings"] or [])},
        "attackers": attackers_section(given["attacker"] or []),
        "victim": given["victim"],
        "frames": given["frames"],
    }
    AttackRequest((attack_spec(tree),)).check()


@pytest.mark.parametrize("block", [one for one in blocks.of("yaml") if not one.file_name], ids=blocks.where)
def test_documents_load(block: blocks.Block, tmp_path: Path) -> None:
    """As a scenario; a part of one is put into the smallest scenario that there is. Those that are
    files, `carry_out.py` writes."""
    tree = yaml.safe_load(block.text)
    whole = {"name": "part", "map": {"generator": {"kind": "grid", "size": 3}}} | tree
    for name in ("my_town.net.xml", "poses.csv", "my_car.obj"):
        (tmp_path / name).write_text("")  # a file has to exist; what it holds, the drive reads
    (tmp_path / "scenario.yaml").write_text(yaml.safe_dump(whole), encoding="utf-8")
    scenario = load_scenario(str(tmp_path / "scenario.yaml"))
    for specs in scenario.attacks.values():
        AttackRequest(specs).check()


def test_the_file_of_a_relay_loads(tmp_path: Path) -> None:
    """With its attacks, as the command checks them."""
    (block,) = [one for one in blocks.of("yaml") if one.file_name == "relay.yaml"]
    (tmp_path / "relay.yaml").write_text(block.text, encoding="utf-8")
    AttackRequest(load_relay_settings(tmp_path / "relay.yaml").attacks).check()


def test_examples_import_from_advpipe_alone() -> None:
    """Whatever a newcomer copies needs no internal module; `advpipe.networks` is public, too."""
    sources = {blocks.where(block): block.text for block in blocks.of("python")}
    for path in sorted((blocks.ROOT / "examples").iterdir()):
        if path.suffix == ".py":
            sources[path.name] = path.read_text(encoding="utf-8")
        elif path.suffix == ".ipynb":
            cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
            code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
            sources[path.name] = "\n".join(code)
    modules = {name: set(imported(ast.parse(text))) for name, text in sources.items()}
    assert set().union(*modules.values()) >= {"advpipe", "advpipe.networks"}
    for name, found in modules.items():
        assert {one for one in found if one.startswith("advpipe")} <= {"advpipe", "advpipe.networks"}, name


def imported(tree: ast.AST) -> Iterator[str]:
    """The modules that Python code imports, or reaches through `advpipe`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield str(node.module)
            yield from (f"advpipe.{alias.name}" for alias in node.names if alias.name in INTERNAL)
        elif isinstance(node, ast.Attribute) and node.attr in INTERNAL:
            yield f"advpipe.{node.attr}"
