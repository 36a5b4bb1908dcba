"""Published logs of beacons, for misbehaviour detection: what vehicles received, and what of it was false."""
