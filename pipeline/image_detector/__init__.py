"""Detectors of road users in pictures."""
