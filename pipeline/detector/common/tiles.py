"""The bird's-eye layers on the occupied part of a map alone.

An attack shows the detector a few objects, and most of the map is empty. So only square tiles around the
occupied cells are computed, as a batch of small maps; beyond them every layer reads the activations of an
empty map, which are computed once. Tiles next to each other read each other's cells. What is neglected is how
points act on cells more than `MARGIN_CELLS` away.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Generic, Protocol, TypeVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from advpipe.pipeline.detector.common.backbone2d import Backbone2d, Convolve

TILE_CELLS = 4
"""The side of a tile, in cells of the predictions, or more where the coarsest block needs more."""

MARGIN_CELLS = 4
"""Cells of the features this near to an occupied one are computed. SECOND's gradients then correlate by
.997 or more with those of the whole map, and scores of detections differ by less than .005."""

MOST_TILES = 0.7
"""Where more of a map would be computed, all of it is: tiles take longer for their edges."""


P = TypeVar("P")
"""Predictions of a head: a dataclass of tensors (B, N, ...) in (H, W, A) order, or None."""


P_co = TypeVar("P_co", covariant=True)


class MapHead(Protocol[P_co]):
    """What predicts from the backbone's features. reach: how many cells away a prediction reads them."""

    reach: int

    def __call__(self, features: Tensor, convolve: Convolve = ...) -> P_co:
        """Predictions for features (B, C, H, W); `convolve` as in `Backbone2d.forward`."""

    def state_dict(self) -> dict[str, Tensor]:
        """Its weights, as a module has them."""


class OccupiedMap(Generic[P]):
    """The backbone and the head, with frozen weights, on maps that are mostly empty."""

    def __init__(self, backbone: Backbone2d, head: MapHead[P]) -> None:
        self._backbone, self._head = backbone, head
        self._empty: EmptyMap[P] | None = None
        self._empty_of: object = None

    def __call__(self, bev: Tensor, occupied: Tensor) -> P:
        """Predictions for maps (B, C, H, W), zero except in the `occupied` cells (B, H, W)."""
        scale = self._backbone.stride
        side = max(TILE_CELLS * scale, self._backbone.coarsest)
        margin = (MARGIN_CELLS + self._head.reach) * scale
        is_tiled = not (bev.shape[2] % side or bev.shape[3] % side)
        active = _tiles_near(occupied, side, margin) if is_tiled else occupied
        # Of each map by itself, so that results do not depend on the others in a batch.
        active = active | (active.float().mean((1, 2), keepdim=True) > MOST_TILES)
        if not is_tiled or active.all() or not active.any():
            return self._head(self._backbone(bev))
        empty, tiles = self._empty_map(bev), Tiles(active, side, side // scale)

        def convolve(layer: nn.Conv2d, x: Tensor) -> Tensor:
            halo, after = tiles.halo(x.shape[2]), tiles.halo(x.shape[2] // layer.stride[0])
            return _tile_convolution(x, layer, empty.inputs[layer], halo, after)

        features = self._backbone(tiles.of(bev), convolve)
        return tiles.placed(self._head(features, convolve), empty.predictions)

    def _empty_map(self, bev: Tensor) -> EmptyMap[P]:
        """Computed again where the weights, the map's size or the device are others than before."""
        weights = [*self._backbone.state_dict().values(), *self._head.state_dict().values()]
        now = bev.shape[1:], bev.device, bev.dtype, tuple(weight._version for weight in weights)
        if self._empty is None or now != self._empty_of:
            self._empty, self._empty_of = EmptyMap(self._backbone, self._head, bev), now
        return self._empty


class EmptyMap(Generic[P]):
    """What the layers compute on a map of zeros.

    inputs: of each convolution, (H W + 1, C), of which the last row, zero, stands for cells beyond the map.
    predictions: of the head.
    """

    def __init__(self, backbone: Backbone2d, head: MapHead[P], like: Tensor) -> None:
        self.inputs: dict[nn.Conv2d, Tensor] = {}

        def recorded(layer: nn.Conv2d, x: Tensor) -> Tensor:
            self.inputs[layer] = F.pad(_rows(x), (0, 0, 0, 1))
            output: Tensor = layer(x)
            return output

        with torch.no_grad():
            features = backbone(torch.zeros_like(like[:1].detach()), recorded)
            self.predictions: P = head(features, recorded)


@dataclass(frozen=True)
class Halo:
    """Where N tiles of `size` x `size` cells, framed by one cell on each side, get their cells from.

    source: (N (size + 2)^2,) rows of the tiles' own cells, 0 where a cell lies in no tile. outside: these,
    and `cells`: (R,) their rows in the inputs of an `EmptyMap`.
    """

    size: int
    source: Tensor
    outside: Tensor
    cells: Tensor

    def framed(self, x: Tensor, around: Tensor | None) -> Tensor:
        """Tiles (N, C, size + 2, size + 2) of x (N, C, size, size), between cells of `around` or zeros."""
        framed = _rows(x).index_select(0, self.source)
        if around is None:
            framed.index_fill_(0, self.outside, 0)
        else:
            framed.index_copy_(0, self.outside, around.index_select(0, self.cells))
        return _map(framed, len(x), self.size + 2, self.size + 2)


class Tiles:
    """The tiles of a batch of maps that are computed: those that `active` (B, rows, columns) names.

    side: of a tile in cells of the maps; predicted: in cells of the predictions.
    """

    def __init__(self, active: Tensor, side: int, predicted: int) -> None:
        self._batch, self._row, self._column = active.nonzero().unbind(1)
        self._count = len(self._batch)
        self._number = (active.flatten().cumsum(0).view(active.shape) - 1).masked_fill(~active, -1)
        self._halos: dict[int, Halo] = {}
        self._side, self._predicted, self._maps = side, predicted, active.shape

    def _own_cells(self, size: int) -> Tensor:
        """The rows (N size^2,) of the tiles' cells in maps (B H W, C) whose tiles have this side."""
        _, rows, columns = self._maps
        batch, y, x = self._places(torch.arange(size, device=self._number.device), size)
        return ((batch * rows * size + y) * columns * size + x).flatten()

    def halo(self, size: int) -> Halo:
        """Of tiles with this side, at any scale of the backbone."""
        if size not in self._halos:
            _, rows, columns = self._number.shape
            height, width = rows * size, columns * size
            batch, y, x = self._places(torch.arange(-1, size + 1, device=self._number.device), size)
            is_inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
            y, x = y.clamp(0, height - 1), x.clamp(0, width - 1)
            number = self._number[batch, y // size, x // size]
            is_tiled = is_inside & (number >= 0)
            source = ((number * size + y % size) * size + x % size).masked_fill(~is_tiled, 0)
            outside = (~is_tiled).flatten().nonzero().squeeze(1)
            cells = (y * width + x).masked_fill(~is_inside, height * width).flatten()[outside]
            self._halos[size] = Halo(size, source.flatten(), outside, cells)
        return self._halos[size]

    def of(self, maps: Tensor) -> Tensor:
        """The tiles (N, C, T, T) of maps (B, C, H, W)."""
        rows = _rows(maps).index_select(0, self._own_cells(self._side))
        return _map(rows, self._count, self._side, self._side)

    def placed(self, mine: P, empty: P) -> P:
        """The predictions of the tiles among those of an empty map, for each map of the batch."""
        cells = self._own_cells(self._predicted)
        maps, rows, columns = self._maps
        map_cells = rows * columns * self._predicted**2

        def put(part: Tensor | None, among: Tensor | None) -> Tensor | None:
            if part is None or among is None:
                return None
            whole = among.view(1, map_cells, -1).expand(maps, -1, -1).flatten(0, 1)
            whole = whole.index_copy(0, cells, part.reshape(len(cells), -1))
            return whole.view(maps, *among.shape[1:])

        names = [field.name for field in fields(mine)]  # type: ignore[arg-type]
        return type(mine)(*(put(getattr(mine, name), getattr(empty, name)) for name in names))

    def _places(self, reach: Tensor, size: int) -> tuple[Tensor, Tensor, Tensor]:
        """Batch entry, y and x (N, K, K) of the cells at these offsets (K,) in each tile."""
        y = ((self._row * size)[:, None] + reach)[:, :, None].expand(-1, -1, len(reach))
        x = ((self._column * size)[:, None] + reach)[:, None].expand(-1, len(reach), -1)
        return self._batch[:, None, None].expand_as(y), y, x


class _TileConvolution(torch.autograd.Function):
    """A 3 x 3 convolution of tiles, between the cells of an empty map; `after`: the halo of its outputs."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, layer: nn.Conv2d, around: Tensor, halo: Halo, after: Halo) -> Tensor:
        ctx.save_for_backward(layer.weight)
        ctx.stride, ctx.after = layer.stride[0], after
        return F.conv2d(halo.framed(x, around), layer.weight, layer.bias, layer.stride)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        (weight,) = ctx.saved_tensors
        framed, stride = ctx.after.framed(grads[0], None), ctx.stride
        # The frame adds a row of outputs before the first; the padding takes what it adds to the inputs.
        to_x = F.conv_transpose2d(framed, weight, None, stride, stride + 1, stride - 1)
        return to_x, None, None, None, None


def _tile_convolution(x: Tensor, layer: nn.Conv2d, around: Tensor, halo: Halo, after: Halo) -> Tensor:
    """Tiles (N, C_out, size / stride, size / stride); the weights get no gradient."""
    out: Tensor = _TileConvolution.apply(x, layer, around, halo, after)  # type: ignore[no-untyped-call]
    return out


def _tiles_near(occupied: Tensor, side: int, margin: int) -> Tensor:
    """The tiles (B, H / side, W / side) with a cell within the margin of an occupied one (B, H, W)."""
    padded = F.pad(occupied.float()[:, None], (margin, margin, margin, margin))
    return F.max_pool2d(padded, 2 * margin + side, side)[:, 0] > 0


def _rows(maps: Tensor) -> Tensor:
    """Cells (B H W, C) of maps (B, C, H, W); no copy where the channels are last in memory."""
    return maps.permute(0, 2, 3, 1).reshape(-1, maps.shape[1])


def _map(rows: Tensor, count: int, height: int, width: int) -> Tensor:
    """Maps (count, C, height, width), channels last in memory, of cells (count height width, C)."""
    return rows.view(count, height, width, -1).permute(0, 3, 1, 2)
