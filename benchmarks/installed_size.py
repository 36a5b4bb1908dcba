"""Measures the disk space of an installation, as the table in docs/install.md.

    python benchmarks/installed_size.py            # of the environment that runs it

A package's own files as pip recorded them, and in the next column what is there for its sake alone: the
packages that would go if it went. Bytecode counts: pip makes it at once, unless told --no-compile.
"""

from __future__ import annotations

import re
from importlib.metadata import Distribution, distribution, distributions

PURPOSES = {
    "torch": "the detector and every LiDAR attack",
    "open3d-cpu": "the ray casting of `simulate`",
    "open3d": "the ray casting of `simulate`",
    "libusb-package": "open3d 0.20 on systems without libusb",
    "eclipse-sumo": "netconvert, netgenerate and sumo as programs: maps and demand",
    "libsumo": "the traffic of `simulate`, step by step",
    "traci": "the same, where SUMO is a server",
    "pycrate": "CAMs in UPER; one of its 300 ASN.1 modules",
    "pyarrow": "labels, results and trajectories in Parquet",
    "scipy": "filters, statistics, nearest neighbours",
    "matplotlib": "figures",
    "pillow": "figures in fewer bytes for pages",
    "numpy": "everything",
    "shapely": "buildings and roads as polygons",
    "pyproj": "GNSS coordinates",
    "pydantic": "scenarios and everything else that is read",
    "rosbags": "ROS 2 types and CDR",
    "mcap": "the MCAP container",
    "zstandard": "chunks of bags",
    "lz4": "chunks of bags of others",
    "safetensors": "the detector's weights",
    "rich": "progress bars and tables",
    "typer": "the command line",
    "jinja2": "reports",
    "markdown-it-py": "data set cards",
    "pyyaml": "scenarios",
}
"""What each dependency is there for."""

WORTH_A_ROW_MB = 20.0


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def required(found: Distribution, installed: dict[str, Distribution]) -> set[str]:
    """The installed packages that one requires; extras count if their packages are there for another."""
    names = {
        canonical(re.split(r"[\s;<>=!~\[(]", line, maxsplit=1)[0])
        for line in found.requires or ()
        if "extra ==" not in line
    }
    return names & installed.keys()


def reachable(roots: set[str], needs: dict[str, set[str]]) -> set[str]:
    seen: set[str] = set()
    todo = list(roots)
    while todo:
        name = todo.pop()
        if name not in seen:
            seen.add(name)
            todo += needs[name]
    return seen


def size_mb(found: Distribution) -> float:
    paths = {found.locate_file(file) for file in found.files or ()}
    return sum(path.stat().st_size for path in paths if path.is_file()) / 1e6  # type: ignore[attr-defined]


def table() -> list[str]:
    installed = {canonical(found.metadata["Name"]): found for found in distributions()}
    needs = {name: required(found, installed) for name, found in installed.items()}
    roots = required(distribution("advpipe"), installed)
    sizes = {name: size_mb(installed[name]) for name in reachable(roots, needs)}
    rows = []
    for root in roots:
        alone = sizes.keys() - reachable(roots - {root}, needs)
        rows.append((sum(sizes[name] for name in alone), len(alone) - 1, root))
    lines = ["| package | MB | with what only it needs, MB | what it is for |", "|---|--:|--:|---|"]
    small = [row for row in rows if max(row[0], sizes[row[2]]) < WORTH_A_ROW_MB]
    for alone_mb, others, root in sorted(set(rows) - set(small), reverse=True):
        also = f"{alone_mb:.0f} ({others} more)" if others > 0 else f"{alone_mb:.0f}"
        release = f"`{root}` {installed[root].version}"
        lines.append(f"| {release} | {sizes[root]:.0f} | {also} | {PURPOSES.get(root, '?')} |")
    names = ", ".join(f"`{root}`" for _, _, root in sorted(small, reverse=True))
    if small:
        lines.append(f"| {names} | {sum(sizes[row[2]] for row in small):.0f} | | see `pyproject.toml` |")
    shared_mb = sum(sizes.values()) - sum(row[0] for row in rows)
    lines.append(f"| what several of them need | | {shared_mb:.0f} | |")
    lines.append(f"| **all {len(sizes)} packages** | | **{sum(sizes.values()):.0f}** | |")
    return lines


if __name__ == "__main__":
    print("\n".join(table()))
