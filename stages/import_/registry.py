"""The forms that can be imported, by their names on the command line."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.stages.import_.files import PointFolderForm
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.rosbag.form import RosbagForm

FORMS: Mapping[str, DriveForm] = {"files": PointFolderForm(), "rosbag": RosbagForm()}


def find_form(name: str) -> DriveForm:
    """The form of a name. Raises UsageError for an unknown one."""
    if name not in FORMS:
        raise UsageError(f"unknown form {name!r}; {known_names(name, FORMS)}")
    return FORMS[name]
