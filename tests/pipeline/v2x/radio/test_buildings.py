import numpy as np
import pytest
import shapely

from advpipe.pipeline.v2x.radio.buildings import Buildings

SQUARE = shapely.box(10, -5, 20, 5)
COURT = shapely.Polygon(shapely.box(0, 0, 30, 30).exterior, [shapely.box(10, 10, 20, 20).exterior])


@pytest.mark.parametrize(
    ("start", "end", "walls", "inside_m"),
    [
        ((0, 0), (30, 0), 2, 10),
        ((30, 0), (0, 0), 2, 10),
        ((0, 6), (30, 6), 0, 0),
        ((0, 0), (9, 0), 0, 0),
        ((0, 0), (15, 0), 1, 5),
        ((15, 0), (0, 0), 1, 5),
        ((12, 1), (18, 9), 1, 5),
        ((12, 1), (15, 1), 0, 3),
    ],
)
def test_a_square_equals_values_computed_by_hand(
    start: tuple, end: tuple, walls: int, inside_m: float
) -> None:
    found = Buildings([SQUARE]).crossings(np.array([start], float), np.array([end], float))
    assert (found[0].item(), found[1].item()) == (walls, pytest.approx(inside_m))


def test_a_courtyard_equals_values_computed_by_hand() -> None:
    walls, inside_m = Buildings([COURT]).crossings(np.array([[-5.0, 15]]), np.array([[15.0, 15], [40, 15]]))
    np.testing.assert_allclose(walls, [[2, 4]])
    np.testing.assert_allclose(inside_m, [[10, 20]])


@pytest.mark.oracle
def test_random_towns_agree_with_shapely() -> None:
    rng = np.random.default_rng(1)
    stars = []
    for centre in rng.uniform(0, 200, (25, 2)):
        angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
        radii_m = rng.uniform(3, 20, (9, 1))
        stars.append(shapely.Polygon(centre + radii_m * np.column_stack([np.cos(angles), np.sin(angles)])))
    senders, receivers = rng.uniform(0, 200, (15, 2)), rng.uniform(0, 200, (40, 2))
    walls, inside_m = Buildings([*stars, COURT]).crossings(senders, receivers)
    pairs = np.stack(np.broadcast_arrays(senders[:, None], receivers[None]), axis=2)
    lines = shapely.linestrings(pairs.reshape(-1, 2, 2)).reshape(15, 40)
    expected_m = sum(shapely.length(shapely.intersection(lines, star)) for star in (*stars, COURT))
    cuts = [shapely.intersection(lines, star.boundary) for star in (*stars, COURT)]
    expected_walls = sum(shapely.get_num_coordinates(cut) for cut in cuts)
    np.testing.assert_allclose(inside_m, expected_m, atol=1e-9)
    np.testing.assert_array_equal(walls, expected_walls)
    assert walls.max() > 10


def test_pairs_that_are_not_requested_are_zero() -> None:
    wanted = np.array([[True, False]])
    walls, inside_m = Buildings([SQUARE]).crossings(np.zeros((1, 2)), np.array([[30.0, 0], [30, 0]]), wanted)
    assert (walls.tolist(), inside_m.tolist()) == ([[2, 0]], [[10, 0]])


def test_without_buildings_nothing_is_crossed() -> None:
    walls, inside_m = Buildings([]).crossings(np.zeros((2, 2)), np.ones((3, 2)))
    assert walls.shape == inside_m.shape == (2, 3)
    assert not walls.any()
