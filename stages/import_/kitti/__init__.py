"""KITTI: frames of the object benchmark, raw drives, sequences of the odometry benchmark."""
