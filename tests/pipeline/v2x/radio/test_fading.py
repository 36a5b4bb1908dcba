import numpy as np
import pytest
from scipy.stats import gamma

from advpipe.pipeline.v2x.radio.fading import nakagami_db, shadowing_db

UNIFORM = (np.arange(20000) + 0.5) / 20000
SHAPES = {1.0: 3.01, 4.7: 3.01, 5.0: 1.18, 20.0: 1.94, 60.0: 1.86, 177.0: 0.45, 178.0: 0.32, 5000.0: 0.32}


@pytest.mark.oracle
@pytest.mark.parametrize(("distance_m", "shape"), SHAPES.items())
def test_nakagami_is_the_gamma_distribution(distance_m: float, shape: float) -> None:
    gain_db = nakagami_db(UNIFORM, np.full(len(UNIFORM), distance_m))
    np.testing.assert_allclose(gain_db, 10 * np.log10(gamma.ppf(UNIFORM, shape, scale=1 / shape)), atol=1e-3)


def test_nakagami_is_finite_at_the_extreme_draws() -> None:
    ends = np.array([2.0**-54, 1 - 2.0**-53])
    gain_db = nakagami_db(ends, np.array([300.0, 300.0]))
    assert gain_db[0] < -400 and 15 < gain_db[1] < 25  # noqa: PT018


def test_shadowing_has_its_standard_deviation() -> None:
    gain_db = shadowing_db(UNIFORM, np.full(len(UNIFORM), 5.6))
    assert np.std(gain_db) == pytest.approx(5.6, rel=1e-3)
    assert shadowing_db(np.array([0.8413447]), np.array([8.1]))[0] == pytest.approx(8.1, rel=1e-6)
