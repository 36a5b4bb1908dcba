"""Bags as data sets in the form of nuScenes."""
