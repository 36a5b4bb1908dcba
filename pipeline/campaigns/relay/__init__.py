"""Stands between the publishers and the consumers of a running ROS 2 graph, and attacks what passes."""
