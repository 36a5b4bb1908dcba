"""Artery as the V2X network and master clock: a process of its own, which advpipe's module in it connects."""
