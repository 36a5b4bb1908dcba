"""The checks of `advpipe verify`, one subject per file."""
