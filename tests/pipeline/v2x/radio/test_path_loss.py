import numpy as np
import pytest

from advpipe.pipeline.v2x.radio.path_loss import PATH_LOSS
from advpipe.pipeline.v2x.section import Radio

RADIO = Radio()


def test_free_space_loss_at_one_metre_is_known() -> None:
    loss_db = PATH_LOSS["free_space"](np.array([1.0, 0.1, 10.0]), RADIO)
    np.testing.assert_allclose(loss_db, [47.86, 47.86, 67.86], atol=0.005)


@pytest.mark.parametrize(
    ("model", "reach_m"), [("free_space", (720, 1017, 1612, 2276)), ("dual_slope", (268, 319, 401, 477))]
)
def test_the_reach_at_23_dbm_is_known(model: str, reach_m: tuple[float, ...]) -> None:
    received_dbm = 23 - PATH_LOSS[model](np.array(reach_m, np.float64), RADIO)
    np.testing.assert_allclose(received_dbm, [-82, -85, -89, -92], atol=0.03)


def test_the_slopes_meet() -> None:
    for model in PATH_LOSS.values():
        near_db, far_db = model(np.array([99.9999, 100.0001]), RADIO)
        assert 0 < far_db - near_db < 1e-4
