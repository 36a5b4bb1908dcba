"""SUMO's network file: the user's, or converted or generated; checked before SUMO loads it."""

from __future__ import annotations

import re
import subprocess
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.missing_library import loader_line
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.scenario.map import Generator, Map
from advpipe.stages.simulate.road_network.bounded_xml import refuse_xml_bombs
from advpipe.stages.simulate.road_network.check import check_network, check_opendrive
from advpipe.stages.simulate.road_network.repair import repair_lanes

TIMEOUT_S = 600.0
"""Loading a map of 38 MB with 64,000 lanes takes a tenth of this."""

GUESSED_LIGHTS = ("--tls.guess", "--tls.default-type", "actuated", "--tls.max-dur", "25")


@dataclass(frozen=True)
class NetworkFile:
    """`sumo_file` is loaded by SUMO, `map_file` is its source, `origin` its name in messages."""

    sumo_file: Path
    map_file: Path
    origin: str


def prepare_network_file(source: Map, scratch: Path, seed: int) -> NetworkFile:
    """Prepare the SUMO network of a scenario's map, and check that SUMO loads it."""
    if source.opendrive is not None:
        map_file = Path(source.opendrive)
        prepared = NetworkFile(_convert_opendrive(map_file, scratch), map_file, str(map_file))
        check_network(ElementTree.parse(prepared.sumo_file).getroot(), prepared.origin)
        repair_lanes(prepared.sumo_file)
    elif source.generator is not None:
        sumo_file = _generate(source.generator, scratch, seed)
        prepared = NetworkFile(sumo_file, sumo_file, "map.generator")
    else:
        assert source.sumo_net is not None
        map_file = Path(source.sumo_net)
        root = check_xml(map_file, "map.sumo_net", ("net",), "a SUMO network (.net.xml)")
        prepared = NetworkFile(map_file, map_file, str(map_file))
        check_network(root, prepared.origin)
    # SUMO loads it in a separate process, which an invalid file may crash.
    options = ["--net-file", str(prepared.sumo_file), "--begin", "0", "--end", "0.1"]
    done = run_sumo("sumo", [*options, "--no-step-log", "--no-warnings"], prepared.origin)
    if done.returncode != 0:
        raise AdvpipeError(f"{prepared.origin}: SUMO cannot load the network: {last_error(done)}")
    return prepared


def check_xml(path: Path, key: str, root_tags: tuple[str, ...], description: str) -> ElementTree.Element:
    """The root element of an XML file with one of the `root_tags`. Raises AdvpipeError for any other file.

    key: of the scenario. description: of the expected file; both for error messages.
    """
    if not path.is_file():
        hint = f"give its path with {option_name('settings')} {key}=FILE"
        raise AdvpipeError(f"{key}: {path} {'is not a file' if path.exists() else 'does not exist'}; {hint}")
    if path.stat().st_size == 0:
        raise AdvpipeError(f"{key}: {path} is empty")
    refuse_xml_bombs(path, f"{key}: {path}")
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, ValueError, UnicodeError, LookupError) as error:
        raise AdvpipeError(f"{key}: {path} is not {description}, or is truncated: {error}") from None
    tag = root.tag.rpartition("}")[2]  # OpenDRIVE from 1.5 on has a namespace
    if tag not in root_tags:
        raise AdvpipeError(
            f"{key}: {path} is not {description}: its root element is <{tag}>, not <{root_tags[0]}>"
        )
    return root


def sumo_program(name: str) -> str:
    """The path of a SUMO program of the eclipse-sumo package."""
    import sumo

    return str(Path(sumo.SUMO_HOME) / "bin" / name)


def run_sumo(
    name: str, options: Sequence[str], origin: str, timeout_s: float = TIMEOUT_S
) -> subprocess.CompletedProcess[str]:
    """Run a SUMO program to its end; raise AdvpipeError if it cannot start or exceeds `timeout_s`.

    origin: the name of its input in error messages.
    """
    try:
        done = subprocess.run(
            [sumo_program(name), *options],
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=timeout_s,
        )
    except subprocess.TimeoutExpired:
        raise AdvpipeError(f"{origin}: {name} did not finish with it within {timeout_s:g} s") from None
    if done.returncode == 127 and (missing := loader_line(done.stderr)):
        raise AdvpipeError(f"{name}: {missing}")
    return done


def last_error(done: subprocess.CompletedProcess[str]) -> str:
    """The error message of a failed SUMO program, in one line."""
    if done.returncode < 0:
        return f"it crashed with signal {-done.returncode}"
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip().startswith("Error")]
    return re.sub(r"^Error:\s*", "", lines[0]) if lines else f"exit code {done.returncode}"


def _convert_opendrive(path: Path, scratch: Path) -> Path:
    """Convert with netconvert, which guesses traffic lights for a map without a single signal.

    Without them, vehicles never get to turn left across five lanes of dense traffic.
    """
    root = check_xml(path, "map.opendrive", ("OpenDRIVE",), "an OpenDRIVE map (.xodr)")
    check_opendrive(root, str(path))
    out = scratch / "network.net.xml"
    command = ["--opendrive-files", str(path), "--output-file", str(out), "--no-warnings"]
    if root.find(".//{*}signal") is None:
        command += [*GUESSED_LIGHTS]
    done = run_sumo("netconvert", command, str(path))
    if done.returncode != 0 or not out.is_file():
        raise AdvpipeError(f"{path}: netconvert cannot read it: {last_error(done)}")
    return out


def _generate(generator: Generator, scratch: Path, seed: int) -> Path:
    """Generate with netgenerate. The comment at the head of its output is removed: it holds a date and
    paths."""
    block_m = str(generator.block_m)
    shapes = {
        "grid": ["--grid", "--grid.number", str(generator.size), "--grid.length", block_m],
        "spider": ["--spider", "--spider.arm-number", str(max(generator.size, 3))]
        + ["--spider.circle-number", str(max(generator.size // 2, 1)), "--spider.space-radius", block_m],
        "random": ["--rand", "--rand.iterations", str(generator.size**2)]
        + ["--rand.min-distance", str(0.6 * generator.block_m)]
        + ["--rand.max-distance", str(1.4 * generator.block_m)],
    }
    out = scratch / "generated.net.xml"
    command = [*shapes[generator.kind], "--seed", str(seed % 2**31), "--output-file", str(out)]
    command += ["--default.lanenumber", str(generator.lanes), "--default.speed", str(generator.speed_mps)]
    command += [*GUESSED_LIGHTS, "--no-turnarounds.except-deadend", "true"]
    done = run_sumo("netgenerate", command, "map.generator")
    if done.returncode != 0 or not out.is_file():
        raise AdvpipeError(f"map.generator: netgenerate cannot generate this network: {last_error(done)}")
    text = re.sub(r"<!--.*?-->\s*", "", out.read_text(encoding="utf-8"), flags=re.DOTALL)
    out.write_text(text, encoding="utf-8")
    return out
