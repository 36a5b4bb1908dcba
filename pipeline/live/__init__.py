"""Publish a bag's messages to running programs: ROS 2 nodes by DDS, Foxglove by its WebSocket."""
