"""What GNSS attacks did to fixes, as Parquet beside an adversarial bag: a row for each fix of each victim."""

from __future__ import annotations

from advpipe.pipeline.labels.columns import Columns

FILE = "gnss_labels.parquet"

GEOGRAPHIC = ("latitude_deg", "longitude_deg", "altitude_m")
OFFSETS = ("offset_east_m", "offset_north_m", "offset_up_m")

FIX_COLUMNS: Columns = {
    "vehicle": "string",
    "fix": "int32",
    "stamp_ns": "int64",
    "attack": "string",
    **{f"{kind}_{name}": "float64" for kind in ("true", "false") for name in GEOGRAPHIC},
    **dict.fromkeys((*OFFSETS, "squared_sigmas"), "float64"),
    "mattered": "bool",
}
"""By victim and then by time. fix: counts the vehicle's fixes; attack: its name, null where none was on; true
and false latitude_deg, longitude_deg, altitude_m: what the receiver would have said and what it says, null
without a fix; offset_east_m, offset_north_m, offset_up_m: false minus true; squared_sigmas: the offset in the
receiver's own covariance; mattered: whether it is missing, or as far off as matters in messages, too
(`pipeline/v2x/facilities/effect.py`). Who spoofs is no station of the bag, and so no column.
"""
