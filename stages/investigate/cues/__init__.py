"""The cues: what speaks against a sensor or a station."""
