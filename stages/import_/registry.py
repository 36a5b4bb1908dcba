"""The forms that can be imported, by their names on the command line."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.stages.import_.av2.form import Av2Form
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.nuscenes.form import NuscenesForm
from advpipe.stages.import_.opv2v.form import Opv2vForm

FORMS: Mapping[str, DriveForm] = {
    "nuscenes": NuscenesForm(),
    "av2": Av2Form(),
    "opv2v": Opv2vForm(),
}


def find_form(name: str) -> DriveForm:
    """The form of a name. Raises UsageError for an unknown one."""
    if name not in FORMS:
        raise UsageError(f"unknown form {name!r}; {known_names(name, FORMS)}")
    return FORMS[name]
