"""The data set that comes with advpipe: data, found through `importlib.resources`; `make sample` makes it."""
