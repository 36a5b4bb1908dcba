"""msgs/ is a ROS 2 package that builds: its lists name every definition, and every package these use."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from importlib.resources import files
from pathlib import Path

from advpipe.pipeline.messages.types import typestore

PACKAGE = Path(str(files("advpipe.pipeline.messages.msgs")))
CMAKE = (PACKAGE / "CMakeLists.txt").read_text(encoding="utf-8")
DEFINITIONS = sorted((PACKAGE / "msg").glob("*.msg"))


def used_packages() -> set[str]:
    fields = re.compile(r"^(\w+)/\w+", re.MULTILINE)
    texts = [path.read_text(encoding="utf-8") for path in DEFINITIONS]
    return {package for text in texts for package in fields.findall(text)} - {"advpipe_msgs"}


def test_every_definition_is_built_and_registered() -> None:
    assert re.findall(r'"msg/(\w+)\.msg"', CMAKE) == [path.stem for path in DEFINITIONS]
    assert {f"advpipe_msgs/msg/{path.stem}" for path in DEFINITIONS} <= set(typestore().types)


def test_the_declared_dependencies_are_those_used() -> None:
    assert used_packages() == {"std_msgs", "geometry_msgs", "builtin_interfaces"}
    (listed,) = re.findall(r"DEPENDENCIES ([\w ]+)", CMAKE)
    assert set(listed.split()) == used_packages()
    found = set(re.findall(r"find_package\((\w+) REQUIRED\)", CMAKE))
    assert found == used_packages() | {"ament_cmake", "rosidl_default_generators"}
    depends = {element.text for element in ElementTree.parse(PACKAGE / "package.xml").findall("depend")}
    assert depends == used_packages()
