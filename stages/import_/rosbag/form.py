"""The form `rosbag`: recordings of ROS 1 and ROS 2."""

from __future__ import annotations

from pathlib import Path

from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.named_boxes import USUAL_CLASSES
from advpipe.stages.import_.options import ImportOptions
from advpipe.stages.import_.rosbag.drive import RecordedDrive
from advpipe.stages.import_.rosbag.recording import open_recording
from advpipe.stages.import_.rosbag.topics import choose_topics


class RosbagForm(DriveForm):
    """A .bag of ROS 1, or a rosbag2 directory or file (MCAP or SQLite) of ROS 2."""

    title = "a recording of ROS 1 or ROS 2, CARLA's ROS bridge among them"
    takes = ("lidar_height_m", "points", "objects", "scale_intensity", "classes")
    classes = USUAL_CLASSES

    def open(self, source: Path, options: ImportOptions) -> RecordedDrive:
        """See `DriveForm.open`."""
        recording = open_recording(source)
        topics = choose_topics(recording, options.points, options.objects)
        return RecordedDrive(recording, topics, options, self.class_map(options))
