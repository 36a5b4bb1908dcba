"""What is drawn of the roads."""

import numpy as np
from matplotlib.figure import Figure

from advpipe.pipeline.misbehaviour.roads import RoadMap
from advpipe.stages.evaluate.v2x.ldm_error import Known
from advpipe.stages.evaluate.v2x.picture import REACH_M, _draw_roads


def test_roads_that_cross_the_map_are_drawn():
    """A straight motorway begins and ends far outside; what passes by the corner is not seen."""
    own = Known(1, 1000.0, 500.0, 0.0, 10.0, 4.5, 1.8)
    through = [[0.0, 500.0], [2000.0, 520.0]]
    inside = [[1010.0, 500.0], [1020.0, 510.0]]
    beside = [[0.0, 500.0 + REACH_M + 1], [2000.0, 500.0 + REACH_M + 1]]
    roads = RoadMap(np.array([through, inside, beside]), np.full(3, 3.2))
    axes = Figure().add_subplot()
    _draw_roads(axes, roads, own)
    drawn = axes.collections[0].get_segments()
    assert [(piece + (1000.0, 500.0)).tolist() for piece in drawn] == [through, inside]
