"""Bags in the forms of other data sets."""
