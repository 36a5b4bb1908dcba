"""Find bags: a data set folder, a rosbag2 directory or an .mcap file all name one."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.bag.files import METADATA_NAME
from advpipe.pipeline.bag.foreign import refuse_foreign
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.remote_path import located

CLEAN_NAME = "clean"


def bag_named(path: Path) -> Path:
    """The same folder by its own name, so that there can be something beside it: `.` and `..` have none."""
    return path.resolve() if path.name in ("", "..") else path


def resolve_bag(path: Path) -> Path:
    """The bag that a path names: a data set's clean bag, a rosbag2 directory or an .mcap file itself."""
    path = bag_named(located(path))
    if _is_dataset(path):
        return path / CLEAN_NAME
    if (path / METADATA_NAME).is_file():
        return path
    refuse_foreign(path)
    if path.is_file():
        return path
    if not path.exists():
        raise UsageError(f"{path} does not exist; give a data set, a rosbag2 directory or an .mcap file")
    raise UsageError(
        f"{path} is not a bag: neither a data set (with {CLEAN_NAME}/), nor a rosbag2 directory (with "
        f"{METADATA_NAME}), "
        "nor an .mcap file"
    )


def newest_dataset(root: Path) -> Path:
    """The data set under `root` whose clean bag was written last."""
    folders = [path for path in root.iterdir() if _is_dataset(path)] if root.is_dir() else []
    visible = [path for path in folders if not path.name.startswith(".")]
    if not visible:
        raise UsageError(f"no data set under {root}; make one with `advpipe simulate`, or name a bag")
    return max(visible, key=lambda path: ((path / CLEAN_NAME / METADATA_NAME).stat().st_mtime_ns, path.name))


def adversarial_bags(dataset: Path) -> list[Path]:
    """All bags of a data set but the clean one, by name; bags in the making are left out."""
    return [
        path
        for path in sorted(dataset.iterdir())
        if (path / METADATA_NAME).is_file() and path.name != CLEAN_NAME and not path.name.startswith(".")
    ]


def _is_dataset(path: Path) -> bool:
    return (path / CLEAN_NAME / METADATA_NAME).is_file()
