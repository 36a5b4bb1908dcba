"""The ROS 2 package `advpipe_msgs`; build it with colcon for live nodes that subscribe to its topics."""
