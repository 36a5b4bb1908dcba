"""ETSI ITS-G5 in this process: stations, their clock, and the radio."""
