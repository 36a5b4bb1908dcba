"""Footprints of buildings as a text in a bag: GeoJSON in metres on the map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field, model_validator

from advpipe.pipeline.core.document import Document, read_json
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.message_bounds import FARTHEST_M

LIMIT_BYTES = 64 << 20
_MOST_CORNERS = 10_000
_MOST_FOOTPRINTS = 1_000_000

_Metres = Annotated[float, Field(strict=True, ge=-FARTHEST_M, le=FARTHEST_M)]
_Ring = Annotated[tuple[tuple[_Metres, _Metres], ...], Field(min_length=4, max_length=_MOST_CORNERS)]
_Polygon = Annotated[tuple[_Ring, ...], Field(min_length=1, max_length=1000)]


class _MultiPolygon(Document):
    """RFC 7946, 3.1.7, with two coordinates a corner."""

    type: Literal["MultiPolygon"]
    coordinates: Annotated[tuple[_Polygon, ...], Field(max_length=_MOST_FOOTPRINTS)]

    @model_validator(mode="after")
    def _closed(self) -> _MultiPolygon:
        for place, polygon in enumerate(self.coordinates):
            if any(ring[0] != ring[-1] for ring in polygon):
                raise ValueError(f"polygon {place} is not closed")
        return self


def footprints_text(footprints: Sequence[shapely.Polygon]) -> str:
    """Footprints as a GeoJSON MultiPolygon in metres on the map; every coordinate to the bit."""
    return str(shapely.to_geojson(shapely.MultiPolygon(list(footprints))))


def footprints_of_text(text: str, where: str) -> list[shapely.Polygon]:
    """The footprints in such a text. Raises AdvpipeError for another one; where: the file and the topic."""
    found: _MultiPolygon = read_json(text, _MultiPolygon, where, "record it again", LIMIT_BYTES)
    footprints = [shapely.Polygon(rings[0], rings[1:]) for rings in found.coordinates]
    (bad,) = np.nonzero(~shapely.is_valid(np.array(footprints, dtype=object)))
    if len(bad):
        reason = shapely.is_valid_reason(footprints[bad[0]])
        raise AdvpipeError(f"{where}: polygon {bad[0]} is invalid ({reason}); record it again")
    return footprints
