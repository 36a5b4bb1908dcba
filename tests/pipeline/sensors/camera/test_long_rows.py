"""Products with long rows are those of linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.sensors.camera.long_rows import along, chosen_columns, turned


def test_products_are_those_of_matrices() -> None:
    rng = np.random.default_rng(1)
    matrix, vectors = rng.normal(size=(3, 3)), rng.normal(size=(3, 50)).astype(np.float32)
    assert turned(matrix, vectors) == pytest.approx(matrix @ vectors, abs=1e-5)
    assert along(matrix[0], vectors) == pytest.approx(matrix[0] @ vectors, abs=1e-5)
    assert turned(matrix, vectors).dtype == along(matrix[0], vectors).dtype == np.float32
    assert turned(matrix, vectors[:, :0]).shape == (3, 0)


def test_columns_are_chosen_in_any_order() -> None:
    vectors = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert chosen_columns(vectors, np.array([3, 0, 3])).tolist() == vectors[:, [3, 0, 3]].tolist()
    assert chosen_columns(vectors, np.zeros(0, np.int64)).shape == (3, 0)
