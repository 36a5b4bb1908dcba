"""KITTI's text files of numbers: lines with a key, and tables."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.document import read_text
from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.geometry.transforms import Float64

_LARGEST_BYTES = 1 << 28


def read_keyed_numbers(file: Path) -> dict[str, Float64]:
    """The numbers of each line `KEY: 1.0 2.0`, by its key; a line with another text has no numbers.

    Raises AdvpipeError for an unreadable file.
    """
    found = {}
    for line in read_text(file).splitlines():
        key, colon, rest = line.partition(":")
        if colon:
            try:
                found[key.strip()] = np.array([float(text) for text in rest.split()])
            except ValueError:  # such as the calibration's date
                found[key.strip()] = np.zeros(0)
    return found


def matrix_of(numbers: dict[str, Float64], key: str, shape: tuple[int, ...], file: Path, fix: str) -> Float64:
    """The matrix of one key. fix: what the user can do. Raises AdvpipeError if it is missing or damaged."""
    size = math.prod(shape)
    values = numbers.get(key)
    if values is None:
        raise AdvpipeError(f"{file}: has no line {key} (with {size} numbers); {fix}")
    if values.size != size or not np.isfinite(values).all():
        raise AdvpipeError(f"{file}: the line {key} does not have {size} finite numbers; {fix}")
    return values.reshape(shape)


def read_number_rows(file: Path, columns: int, fix: str) -> Float64:
    """A table (N, columns) of numbers, a row a line; blank lines are skipped.

    Raises AdvpipeError, with the line, for another number of columns and for what is no finite number.
    """
    rows = []
    for number, line in enumerate(read_text(file, _LARGEST_BYTES).splitlines(), 1):
        texts = line.split()
        if not texts:
            continue
        try:
            row = [float(text) for text in texts]
        except ValueError:
            row = []
        if len(row) != columns or not all(map(math.isfinite, row)):
            raise AdvpipeError(
                one_line(
                    f"{file}: line {number} does not have {columns} finite numbers: {line[:60]!r}; {fix}"
                )
            )
        rows.append(row)
    return np.array(rows, np.float64).reshape(-1, columns)
