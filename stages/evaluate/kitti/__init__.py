"""KITTI's own rules, for drives that have its labels."""
