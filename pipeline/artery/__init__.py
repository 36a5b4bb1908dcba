"""Artery as a program: its process, the records of our module in it, and its radio medium."""
