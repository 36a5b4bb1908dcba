"""Misbehaviour detection: which of the CAMs that a vehicle receives it should not believe."""
