"""Message types: those of ROS 2 Humble, of CAMs and their like, vision_msgs, udp_msgs and advpipe_msgs."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

_PACKAGE_FOLDERS = {"vision_msgs": "vision_msgs", "udp_msgs": "udp_msgs", "advpipe_msgs": "msg"}
_LISTS = (Nodetype.ARRAY, Nodetype.SEQUENCE)
_ASN1_PREFIX = "etsi_its_"
"""Packages whose types follow from ASN.1."""

_IDL_STRINGS = re.compile(r'"(?:[^"\\]|\\.)*(?:"|\Z)|//[^\n]*|/\*.*?(?:\*/|\Z)', re.DOTALL)
"""Strings and comments of IDL."""

_ANNOTATION = re.compile(r"@[\w:]+\s*\(")
UNROLLED_LIMIT = 4096
"""Most strings and messages in a type's arrays of fixed length: rosbags generates code for each."""


@cache
def typestore() -> Typestore:
    """All message types that advpipe writes: one store for the process, read-only by convention.

    The types of CAMs and their siblings are added when a function below first needs one of them, since that
    takes a moment.
    """
    store = get_typestore(Stores.ROS2_HUMBLE)
    definitions = files("advpipe.pipeline.messages.msgs")
    for package, folder in _PACKAGE_FOLDERS.items():
        texts = sorted((f for f in (definitions / folder).iterdir() if f.name.endswith(".msg")), key=str)
        for text in texts:
            name = f"{package}/msg/{text.name.removesuffix('.msg')}"
            store.register(get_types_from_msg(text.read_text(encoding="utf-8"), name))
    return store


@cache
def message_class(type_name: str) -> Any:
    """The dataclass of a ROS 2 type, such as `message_class("std_msgs/msg/Header")`.

    Raises KeyError for a type that neither ROS 2 Humble's common packages nor advpipe's own define.
    """
    return _store_of(type_name).types[type_name]


@cache
def schema_text(type_name: str) -> str:
    """The definition of a type and of all types inside it, as in a `ros2msg` schema of MCAP."""
    return _store_of(type_name).generate_msgdef(type_name, ros_version=2)[0]


@cache
def type_hash(type_name: str) -> str:
    """The RIHS01 hash (REP-2011) by which ROS 2 distinguishes two types of the same name."""
    return _store_of(type_name).hash_rihs01(type_name)


def types_from(definition: str, encoding: str, type_name: str) -> Typesdict:
    """Parse the types that a bag defines, by name; encoding: `ros2msg` or `ros2idl`.

    Raises ValueError for arrays that are too long to generate code for and for empty arrays (any number of
    them fits into an empty message), and the exceptions of rosbags for an invalid definition.
    """
    is_idl = encoding == "ros2idl"
    if is_idl:
        code = _IDL_STRINGS.sub("", definition)
        if code.count("(") > len(_ANNOTATION.findall(code)):  # rosbags takes minutes to parse two of them
            raise ValueError(f"the definition of {type_name} has sums in parentheses")
    types = get_types_from_idl(definition) if is_idl else get_types_from_msg(definition, type_name)
    unrolled = 0
    for _, fields in types.values():
        for _, description in fields:
            if description[0] == Nodetype.ARRAY:
                item, length = description[1]
                if not length:
                    raise ValueError(f"{type_name} has an array of no items")
                unrolled += length if item[0] == Nodetype.NAME or item[1][0] == "string" else 0
    if unrolled > UNROLLED_LIMIT:
        raise ValueError(f"{type_name} has arrays of {unrolled} items, more than {UNROLLED_LIMIT}")
    return types


def missing_field(store: Typestore, type_name: str) -> str:
    """The first field of an advpipe type, or of a type inside it, that another store defines differently.

    "" if the store's type has all fields of advpipe's type; it may have more.
    """
    store_fields = dict(store.fielddefs[type_name][1])
    for name, description in typestore().fielddefs[type_name][1]:
        if store_fields.get(name) != description:
            return f"{type_name}.{name}"
        item: Any = description[1][0] if description[0] in _LISTS else description  # node type and its name
        if item[0] == Nodetype.NAME and (found := missing_field(store, item[1])):
            return found
    return ""


def serialise(message: object, type_name: str) -> bytes:
    """The message, an instance of `message_class(type_name)`, in little-endian CDR with its header of four
    bytes."""
    return bytes(_store_of(type_name).serialize_cdr(message, type_name))


def _store_of(type_name: str) -> Typestore:
    package = type_name.partition("/")[0]
    return _typestore_with(package) if package.startswith(_ASN1_PREFIX) else typestore()


@cache
def _typestore_with(package: str) -> Typestore:
    from advpipe.pipeline.messages.cam_types import definitions

    store = typestore()
    store.register(definitions(package))
    return store
