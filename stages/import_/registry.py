"""The forms that can be imported, by their names on the command line."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import import_object
from advpipe.pipeline.core.nearest import known_names
from advpipe.stages.import_.av2.form import Av2Form
from advpipe.stages.import_.files import PointFolderForm
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.kitti.form import KittiForm
from advpipe.stages.import_.nuscenes.form import NuscenesForm
from advpipe.stages.import_.openpcdet import OpenPcdetForm
from advpipe.stages.import_.options import FORM_NAMES
from advpipe.stages.import_.opv2v.form import Opv2vForm
from advpipe.stages.import_.rosbag.form import RosbagForm

FORMS: Mapping[str, DriveForm] = {
    "kitti": KittiForm(),
    "openpcdet": OpenPcdetForm(),
    "nuscenes": NuscenesForm(),
    "av2": Av2Form(),
    "opv2v": Opv2vForm(),
    "files": PointFolderForm(),
    "rosbag": RosbagForm(),
}


def find_form(name: str) -> DriveForm:
    """The form of a name, or an instance of a user's `module:Class`. Raises UsageError for an unknown one."""
    if name in FORMS:
        return FORMS[name]
    if ":" not in name:
        known = known_names(name, {**FORMS, **dict.fromkeys(FORM_NAMES)})
        raise UsageError(f"unknown form {name!r}; {known} (or your own module:Class)")
    found = import_object(name, f"cannot load form {name}")
    if not (isinstance(found, type) and issubclass(found, DriveForm)):
        raise UsageError(f"{name} is not a form: it has to inherit from DriveForm")
    return found()
