"""Shipped scenario files and their road networks: data, found through `importlib.resources`."""
