"""The ROS 2 package `advpipe_msgs`: build it with colcon where live nodes read its topics."""
