"""A layout for Foxglove and Lichtblick that shows the scene of a bag."""

from __future__ import annotations

import json
from typing import Any

from advpipe.pipeline.viewer_layouts.scene import ViewerScene

_SCENE, _SPEED, _TOPICS = "3D!scene", "Plot!speed", "RawMessages!objects"

IMAGE_DISPLAY = "Image"
"""The class of RViz's display of images, which get panels of their own."""

MOST_IMAGES = 3


def foxglove_layout(scene: ViewerScene) -> str:
    """JSON that `Layouts > Import from file` takes: the scene from above the ego, its speed, its objects.

    Panels and keys are those of the layouts that Foxglove exports (version 2 of its 3D panel). The root frame
    is hidden, or a line from the ego to the map's origin would cross the scene.
    """
    panels: dict[str, Any] = {_SCENE: _scene(scene)}
    images = [topic.name for topic, panel in scene.panels if panel.rviz == IMAGE_DISPLAY]
    below = [f"Image!{name.strip('/').replace('/', '_')}" for name in images[:MOST_IMAGES]]
    panels |= {key: _image(name) for key, name in zip(below, images, strict=False)}
    if scene.speed is not None:
        panels[_SPEED] = _plot(f"{scene.speed}.twist.twist.linear.x", "speed, m/s")
        below.append(_SPEED)
    if scene.truth is not None:
        panels[_TOPICS] = {"topicPath": scene.truth, "diffEnabled": False, "expansion": "none"}
        below.append(_TOPICS)
    layout: Any = _SCENE
    if below:
        side: Any = below[-1]
        for key in below[-2::-1]:
            side = {"first": key, "second": side, "direction": "column"}
        layout = {"first": _SCENE, "second": side, "direction": "row", "splitPercentage": 72}
    document = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": layout,
    }
    return json.dumps(document, indent=1) + "\n"


def _scene(scene: ViewerScene) -> dict[str, Any]:
    topics: dict[str, Any] = {
        topic.name: {"visible": True, **panel.foxglove}
        for topic, panel in scene.panels
        if panel.rviz != IMAGE_DISPLAY
    }
    topics |= {topic.name: {"visible": True} for topic in scene.markers}
    return {
        "cameraState": {
            "perspective": True,
            "distance": 70,
            "phi": 55,
            "thetaOffset": 90,
            "targetOffset": [0, 0, 0],
            "target": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.5,
            "far": 5000,
        },
        "followMode": "follow-pose",
        "followTf": scene.ego_frame,
        "scene": {"backgroundColor": "#10141a"},
        "transforms": {f"frame:{scene.root_frame}": {"visible": False}},
        "topics": topics,
        "layers": {
            "grid": {
                "visible": True,
                "layerId": "foxglove.Grid",
                "instanceId": "grid",
                "frameId": scene.ego_frame,
                "size": 200,
                "divisions": 20,
                "lineWidth": 1,
                "color": "#24476b",
                "position": [0, 0, 0],
                "rotation": [0, 0, 0],
            }
        },
    }


def _image(topic: str) -> dict[str, Any]:
    """A panel of a camera's images, whose calibration is beside them."""
    calibration = f"{topic.rsplit('/', 2)[0]}/camera_info"
    return {"imageMode": {"imageTopic": topic, "calibrationTopic": calibration}}


def _plot(path: str, label: str) -> dict[str, Any]:
    return {
        "paths": [{"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}],
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }
