"""KITTI's text files: calibration and labels, read and written."""
