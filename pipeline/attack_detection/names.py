"""The names of the attack checks, for options and shells: importing their classes takes half a second."""

from __future__ import annotations

POINT_CHECKS = ("ray", "voxel-face", "density", "occlusion-order")
"""Those that read points alone. They are cheap, and evaluations run them by default."""

BOX_CHECKS = ("carlo", "shadow-catcher")
"""Published ones, which judge detected boxes."""

SEQUENCE_CHECKS = ("temporal",)
"""Those that judge the detections in consecutive clouds."""

ALL, NONE = "all", "none"
