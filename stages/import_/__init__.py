"""Data sets of others as data sets of advpipe: real drives and other simulators."""
