"""How Parquet stores a field of a row that is not stored as its Python type usually is."""

from __future__ import annotations

from typing import Annotated

DICTIONARY, INT32 = "dictionary", "int32"

Category = Annotated[str, DICTIONARY]
"""One of a few texts: each is stored once, and a row holds its place among them."""

Number = Annotated[int, INT32]
"""A small number, such as that of a box in its frame."""
