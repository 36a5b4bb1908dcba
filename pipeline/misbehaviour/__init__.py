"""Misbehaviour detection: which received CAMs a vehicle should not trust."""
