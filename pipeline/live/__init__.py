"""Publish a bag's messages to running programs: ROS 2 nodes by DDS, Foxglove by its WebSocket."""

ROS2, FOXGLOVE = "ros2", "foxglove"
PUBLISHERS = (ROS2, FOXGLOVE)
"""The names of the publishers."""

MOST_DOMAIN_ID = 232
"""Of DDS: beyond it, ports would be above 65535."""

FOXGLOVE_PORT = 8765
"""The port at which Foxglove looks for a server."""
