"""A configuration of RViz 2 that shows the scene of a bag: `rviz2 -d scene.rviz`."""

from __future__ import annotations

from typing import Any

import yaml

from advpipe.pipeline.sensors.sensor import Panel
from advpipe.pipeline.viewer_layouts.scene import ViewedTopic, ViewerScene

_DEFAULT = "rviz_default_plugins"


def rviz_config(scene: ViewerScene) -> str:
    """YAML with the sensors, markers, odometry and frames of a bag, seen from behind and above the ego.

    Classes and properties are those of rviz_default_plugins from Humble on.
    """
    displays = [
        {"Class": f"{_DEFAULT}/Grid", "Name": "Grid", "Enabled": True, "Cell Size": 10,
         "Plane Cell Count": 40,
         "Reference Frame": "<Fixed Frame>"},
        {"Class": f"{_DEFAULT}/TF", "Name": "TF", "Enabled": True, "Show Arrows": False, "Marker Scale": 5},
        *(_sensor(topic, panel) for topic, panel in scene.panels),
        *(_display("MarkerArray", topic, depth=10) for topic in scene.markers),
        *(_odometry(topic) for topic in scene.odometry),
    ]  # fmt: skip
    tools = ("Interact", "MoveCamera", "Select", "FocusCamera", "Measure")
    document = {
        "Panels": [
            {"Class": "rviz_common/Displays", "Name": "Displays"},
            {"Class": "rviz_common/Views", "Name": "Views"},
            {"Class": "rviz_common/Time", "Name": "Time", "SyncMode": 0, "SyncSource": ""},
        ],
        "Visualization Manager": {
            "Class": "",
            "Global Options": {
                "Fixed Frame": scene.root_frame,
                "Background Color": "16; 20; 26",
                "Frame Rate": 30,
            },
            "Displays": displays,
            "Tools": [{"Class": f"{_DEFAULT}/{tool}"} for tool in tools],
            "Views": {
                "Current": {
                    "Class": f"{_DEFAULT}/Orbit",
                    "Name": "Current View",
                    "Target Frame": scene.ego_frame,
                    "Distance": 60,
                    "Pitch": 0.6,
                    "Yaw": 3.14,
                    "Focal Point": {"X": 0, "Y": 0, "Z": 0},
                }
            },
        },
    }
    return yaml.safe_dump(document, sort_keys=False, allow_unicode=True)


def _display(display_class: str, topic: ViewedTopic, depth: int) -> dict[str, Any]:
    return {
        "Class": f"{_DEFAULT}/{display_class}",
        "Name": topic.name,
        "Enabled": True,
        "Topic": {
            "Value": topic.name,
            "Depth": depth,
            "History Policy": "Keep Last",
            "Reliability Policy": "Reliable",
            "Durability Policy": "Transient Local" if topic.is_latched else "Volatile",
        },
    }


def _sensor(topic: ViewedTopic, panel: Panel) -> dict[str, Any]:
    return _display(panel.rviz, topic, panel.depth) | dict(panel.rviz_keys)


def _odometry(topic: ViewedTopic) -> dict[str, Any]:
    return _display("Odometry", topic, depth=10) | {"Keep": 100, "Shape": {"Value": "Arrow"}}
