"""Recordings of ROS 1 and of ROS 2 in SQLite, as `import rosbag` reads them; `container` has MCAP."""

from __future__ import annotations

import sqlite3
import tempfile
from pathlib import Path

from hypothesis import strategies as st

from advpipe.stages.import_.checks import DriveChecks
from advpipe.stages.import_.options import ImportOptions
from advpipe.stages.import_.record import frame_messages
from advpipe.stages.import_.rosbag.form import RosbagForm
from tests.fuzz import base
from tests.fuzz.case import Call, Case, Target
from tests.fuzz.edits import edited_bytes
from tests.fuzz.values import TEXTS

ROS1, SQLITE = "town.bag", "town2/town2.db3"
TYPES = (
    *("uint8[1000000000] x", "string[4000] x\n" * 20, "town/A[] a", "float64[] x\n" * 2000),
    *("time[3] t", "x", ""),
)


def _read(place: str) -> Call:
    def call(tree: Path, out: Path) -> str:
        drive = RosbagForm().open(tree / place, ImportOptions())
        checks = DriveChecks(drive.are_related)
        for frame in drive.frames():
            checks.check(frame)
            for _ in frame_messages(frame):
                pass
        return " ".join((*drive.notes, *checks.warnings))

    return call


CALLS = {"ros1": _read(ROS1), "sqlite": _read("town2"), "file": _read(SQLITE)}


@st.composite
def byte_cases(draw: st.DrawFn, calls: tuple[str, ...], place: str, data: bytes) -> Case:
    changed, note = draw(edited_bytes(data))
    return Case(draw(st.sampled_from(calls)), place, changed, note)


@st.composite
def message_cases(draw: st.DrawFn, data: bytes) -> Case:
    """A whole database in which messages, topics or definitions are others."""
    with tempfile.NamedTemporaryFile(suffix=".db3") as file:
        Path(file.name).write_bytes(data)
        database = sqlite3.connect(file.name)
        note = _edit(draw, database)
        database.commit()
        database.close()
        changed = Path(file.name).read_bytes()
    return Case(draw(st.sampled_from(["sqlite", "file"])), SQLITE, changed, note)


def _edit(draw: st.DrawFn, database: sqlite3.Connection) -> str:
    edit = draw(st.sampled_from(["message", "message", "message", "definition", "type", "time", "kind"]))
    count = database.execute("SELECT count(*) FROM messages").fetchone()[0]
    number = draw(st.integers(1, count))
    topic = draw(st.integers(1, database.execute("SELECT count(*) FROM topics").fetchone()[0]))
    if edit == "message":
        (old,) = database.execute("SELECT data FROM messages WHERE id = ?", (number,)).fetchone()
        new, note = draw(edited_bytes(bytes(old)))
        database.execute("UPDATE messages SET data = ? WHERE id = ?", (new, number))
        return f"message {number}: {note}"
    if edit == "definition":
        text = draw(st.one_of(st.sampled_from(TYPES), st.sampled_from(TEXTS)))
        text = text.encode(errors="replace").decode()
        database.execute(
            "UPDATE message_definitions SET encoded_message_definition = ? WHERE id = ?", (text, topic)
        )
        return f"definition {topic} is {text[:40]!r}"
    if edit == "type":
        kind = draw(st.sampled_from(["sensor_msgs/msg/PointCloud2", "tf2_msgs/msg/TFMessage", "a", ""]))
        database.execute("UPDATE topics SET type = ? WHERE id = ?", (kind, topic))
        return f"topic {topic} is {kind!r}"
    value = draw(st.sampled_from([0, -1, 2**63 - 1, "soon"] if edit == "time" else ["soon", 7, 0.5]))
    column = "timestamp" if edit == "time" else "data"
    database.execute(f"UPDATE messages SET {column} = ? WHERE id = ?", (value, number))
    return f"{column} of {number} is {value!r}"


def cases(folder: Path) -> st.SearchStrategy[Case]:
    of_ros1 = byte_cases(("ros1",), ROS1, (folder / ROS1).read_bytes())
    database = (folder / SQLITE).read_bytes()
    of_sqlite = byte_cases(("sqlite", "file"), SQLITE, database)
    return st.one_of(of_ros1, of_ros1, message_cases(database), message_cases(database), of_sqlite)


TARGET = Target("recording", base.RECORDINGS, cases, CALLS)
