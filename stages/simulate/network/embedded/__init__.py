"""ETSI ITS-G5 in this process: stations, their clock, and what they hear."""
