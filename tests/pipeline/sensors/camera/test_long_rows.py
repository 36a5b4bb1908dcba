"""Products with long rows are those of linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.sensors.camera.long_rows import along, turned


def test_products_are_those_of_matrices() -> None:
    rng = np.random.default_rng(1)
    matrix, vectors = rng.normal(size=(3, 3)), rng.normal(size=(3, 50)).astype(np.float32)
    assert turned(matrix, vectors) == pytest.approx(matrix @ vectors, abs=1e-5)
    assert along(matrix[0], vectors) == pytest.approx(matrix[0] @ vectors, abs=1e-5)
    assert turned(matrix, vectors).dtype == along(matrix[0], vectors).dtype == np.float32
    assert turned(matrix, vectors[:, :0]).shape == (3, 0)
