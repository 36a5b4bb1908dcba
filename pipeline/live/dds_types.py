"""DDS types of ROS 2 messages, built from the definitions in a bag; their samples are bytes."""

from __future__ import annotations

from typing import Any

from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl import types as idl
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from advpipe.pipeline.core.errors import one_line
from advpipe.pipeline.live.publisher import PublishedTopic, UnpublishableTypeError
from advpipe.pipeline.messages.types import types_from

_BASE_TYPES: dict[str, Any] = {
    "bool": bool,
    "byte": idl.uint8,
    "octet": idl.uint8,
    "char": idl.uint8,
    "int8": idl.int8,
    "int16": idl.int16,
    "int32": idl.int32,
    "int64": idl.int64,
    "uint8": idl.uint8,
    "uint16": idl.uint16,
    "uint32": idl.uint32,
    "uint64": idl.uint64,
    "float32": idl.float32,
    "float64": idl.float64,
    "string": str,
}

_LONGEST_BOUND = 65535
"""Of a DDS sequence in Cyclone's Python; a longer one is declared without a bound, which has the same CDR."""


def dds_type_name(ros_type: str) -> str:
    """The name under which ROS 2 announces a type on DDS.

    >>> dds_type_name("sensor_msgs/msg/PointCloud2")
    'sensor_msgs::msg::dds_::PointCloud2_'
    """
    *namespace, name = ros_type.split("/")
    return "::".join([*namespace, "dds_", f"{name}_"])


class DdsType:
    """A ROS 2 type, which Cyclone checks messages against and subscribers compare with theirs.

    struct: without a base class of its own, since subscribers would see that in the type. hash: RIHS01
    (REP-2011), by which ROS 2 from Iron on compares definitions. Raises UnpublishableTypeError for a
    definition that is damaged, or has fields that Cyclone's Python does not know (wstring, float128).
    """

    def __init__(self, published: PublishedTopic) -> None:
        self._topic = published.topic
        self._built: dict[str, type[IdlStruct]] = {}
        name, store = published.topic.type, Typestore()
        try:
            self._types = types_from(published.schema, published.schema_encoding, name)
            self.struct = self._struct(name)
            store.register(self._types)
            self.hash = str(store.hash_rihs01(name))
        except UnpublishableTypeError:
            raise
        except Exception as error:  # rosbags and Cyclone fail in any way on a bag's definition
            raise self._refusal(f"its definition cannot be used: {one_line(error)[:200]}") from None

    def sample(self, cdr: bytes) -> Any:
        """A message that is serialised already: its CDR with the header of four bytes."""
        made: Any = object.__new__(self.struct)
        made.serialize = lambda **options: cdr
        return made

    def _struct(self, name: str) -> type[IdlStruct]:
        if name not in self._built:
            fields = {field: self._field(kind, field) for field, kind in self._types[name][1]}
            self._built[name] = make_idl_struct(
                name.rpartition("/")[2], dds_type_name(name), fields, dataclassify=False
            )
        return self._built[name]

    def _field(self, description: Any, field: str) -> Any:
        """A field's type: rosbags describes it as its kind, and a name or the items with their number."""
        kind, detail = description
        if kind == Nodetype.NAME:
            if detail.endswith("/wstring"):
                raise self._refusal(f"its field {field} is a wstring")
            return self._struct(detail)
        if kind == Nodetype.BASE:
            name, length = detail
            if name not in _BASE_TYPES:
                raise self._refusal(f"its field {field} is a {name}")
            return idl.bounded_str[length] if name == "string" and length else _BASE_TYPES[name]
        item, length = self._field(detail[0], field), detail[1]
        if kind == Nodetype.ARRAY:
            return idl.array[item, length]
        return idl.sequence[item, length] if 0 < length <= _LONGEST_BOUND else idl.sequence[item]

    def _refusal(self, reason: str) -> UnpublishableTypeError:
        return UnpublishableTypeError(
            f"{self._topic.name} cannot be published to ROS 2: {self._topic.type}: {reason}"
        )
