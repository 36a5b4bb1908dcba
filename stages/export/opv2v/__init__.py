"""Bags as data sets in the form of OPV2V."""
