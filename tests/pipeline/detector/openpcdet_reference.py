"""The networks of three configurations of OpenPCDet out of spconv's and PyTorch's modules, with its names.

The oracle of the import: its own sparse convolutions, its own pillars, its own order of channels, its own
decoding. spconv gives wrong results on a CPU with more than one thread, and needs ConvAlgo.Native there.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

ANCHORS = ((3.9, 1.6, 1.56, -1.78), (0.8, 0.6, 1.73, -0.6), (1.76, 0.6, 1.73, -0.6))
KITTI_BLOCKS = ((6, 1, 128, 1, 256), (6, 2, 256, 2, 256))
"""Layers, stride, channels, stride and channels of the upsampling; Waymo's CenterPoint has the same."""

PILLAR_BLOCKS = ((4, 2, 64, 1, 128), (6, 2, 128, 2, 128), (6, 2, 256, 4, 128))


def build_second() -> nn.Module:
    """second.yaml of KITTI; its state_dict has the names and shapes of a checkpoint written under spconv
    2."""
    return Sparse(4, [41, 1600, 1408], AnchorHead(512))


def build_centerpoint() -> nn.Module:
    """centerpoint_without_resnet.yaml of Waymo."""
    return Sparse(5, [41, 1504, 1504], CenterHead(512))


class Sparse(nn.Module):
    def __init__(self, c_in, shape, head):
        super().__init__()
        self.register_buffer("global_step", torch.zeros(1, dtype=torch.int64))
        self.backbone_3d, self.backbone_2d = backbone3d(c_in, shape), Backbone2d(256, KITTI_BLOCKS)
        self.dense_head = head

    def forward(self, features, indices, batch_size=1):
        return self.dense_head(self.backbone_2d(self.backbone_3d(features, indices, batch_size)))


def backbone3d(first_channels: int, shape: list[int]) -> nn.Module:
    import spconv.pytorch as spconv
    from spconv.core import ConvAlgo

    def sparse(kind, c_in, c_out, kernel, key, **geometry):
        convolution = kind(c_in, c_out, kernel, bias=False, indice_key=key, algo=ConvAlgo.Native, **geometry)
        norm = nn.BatchNorm1d(c_out, eps=1e-3, momentum=0.01)
        return spconv.SparseSequential(convolution, norm, nn.ReLU())

    def same(c_in, c_out, key):
        return sparse(spconv.SubMConv3d, c_in, c_out, 3, key, padding=1)

    def down(c_in, c_out, key, kernel=3, stride=2, padding=1):
        return sparse(spconv.SparseConv3d, c_in, c_out, kernel, key, stride=stride, padding=padding)

    class Backbone3d(nn.Module):
        def __init__(self):
            super().__init__()
            self.conv_input = same(first_channels, 16, "subm1")
            self.conv1 = spconv.SparseSequential(same(16, 16, "subm1"))
            for n, c_in, c_out, padding in ((2, 16, 32, 1), (3, 32, 64, 1), (4, 64, 64, (0, 1, 1))):
                layers = (
                    down(c_in, c_out, f"down{n}", padding=padding),
                    same(c_out, c_out, f"subm{n}"),
                    same(c_out, c_out, f"subm{n}"),
                )
                setattr(self, f"conv{n}", spconv.SparseSequential(*layers))
            self.conv_out = down(64, 128, "out", (3, 1, 1), (2, 1, 1), 0)

        def forward(self, features, indices, batch_size):
            x = spconv.SparseConvTensor(features, indices, shape, batch_size)
            for layer in (self.conv_input, self.conv1, self.conv2, self.conv3, self.conv4, self.conv_out):
                x = layer(x)
            dense = x.dense()  # (B, C, D, H, W)
            return dense.view(dense.shape[0], -1, *dense.shape[3:])

    return Backbone3d()


class Pfn(nn.Module):
    def __init__(self):
        super().__init__()
        self.linear = nn.Linear(10, 64, bias=False)
        self.norm = nn.BatchNorm1d(64, eps=1e-3, momentum=0.01)


class PointPillar(nn.Module):
    """pointpillar.yaml of KITTI."""

    def __init__(self):
        super().__init__()
        self.register_buffer("global_step", torch.zeros(1, dtype=torch.int64))
        self.vfe = nn.Module()
        self.vfe.pfn_layers = nn.ModuleList([Pfn()])
        self.backbone_2d, self.dense_head = Backbone2d(64, PILLAR_BLOCKS), AnchorHead(384)

    def forward(self, padded, cells):
        """padded: (V, 32, 10) features of points, zero behind the last; cells: (V, 2) y and x."""
        (pfn,) = self.vfe.pfn_layers
        hidden = pfn.norm(pfn.linear(padded).permute(0, 2, 1)).permute(0, 2, 1)
        bev = torch.zeros(1, 64, 496, 432)
        bev[0, :, cells[:, 0], cells[:, 1]] = torch.relu(hidden).max(1).values.T
        return self.dense_head(self.backbone_2d(bev))


def norm_relu(channels):
    return [nn.BatchNorm2d(channels, eps=1e-3, momentum=0.01), nn.ReLU()]


class Backbone2d(nn.Module):
    def __init__(self, c_in, blocks):
        super().__init__()
        self.blocks, self.deblocks = nn.ModuleList(), nn.ModuleList()
        for layers, stride, c_out, up_stride, up_channels in blocks:
            block = [nn.ZeroPad2d(1), nn.Conv2d(c_in, c_out, 3, stride, bias=False), *norm_relu(c_out)]
            for _ in range(layers - 1):
                block += [nn.Conv2d(c_out, c_out, 3, padding=1, bias=False), *norm_relu(c_out)]
            self.blocks.append(nn.Sequential(*block))
            up = nn.ConvTranspose2d(c_out, up_channels, up_stride, up_stride, bias=False)
            self.deblocks.append(nn.Sequential(up, *norm_relu(up_channels)))
            c_in = c_out

    def forward(self, x):
        ups = []
        for block, up in zip(self.blocks, self.deblocks, strict=True):
            x = block(x)
            ups.append(up(x))
        return torch.cat(ups, 1)


class AnchorHead(nn.Module):
    def __init__(self, c_in):
        super().__init__()
        self.conv_cls, self.conv_box = nn.Conv2d(c_in, 18, 1), nn.Conv2d(c_in, 42, 1)
        self.conv_dir_cls = nn.Conv2d(c_in, 12, 1)

    def forward(self, x):
        heads = ((self.conv_cls, 3), (self.conv_box, 7), (self.conv_dir_cls, 2))
        return [head(x).permute(0, 2, 3, 1).reshape(len(x), -1, width) for head, width in heads]


class CenterHead(nn.Module):
    WIDTHS = (("center", 2), ("center_z", 1), ("dim", 3), ("rot", 2), ("hm", 3))

    def __init__(self, c_in):
        super().__init__()
        self.shared_conv = nn.Sequential(nn.Conv2d(c_in, 64, 3, padding=1), nn.BatchNorm2d(64), nn.ReLU())
        branches = nn.Module()
        for name, width in self.WIDTHS:
            layer = nn.Sequential(nn.Conv2d(64, 64, 3, padding=1), nn.BatchNorm2d(64), nn.ReLU())
            setattr(branches, name, nn.Sequential(layer, nn.Conv2d(64, width, 3, padding=1)))
        self.heads_list = nn.ModuleList([branches])

    def forward(self, x):
        shared = self.shared_conv(x)
        return {name: getattr(self.heads_list[0], name)(shared) for name, _ in self.WIDTHS}


def randomise(net: nn.Module, seed: int) -> nn.Module:
    """Weights that keep the size of what flows through, batch norms that have seen something."""
    generator = torch.Generator().manual_seed(seed)
    for name, value in net.state_dict().items():
        if not value.is_floating_point():
            continue
        if value.ndim > 1:
            fan_in = value[0].numel()
            value.copy_(torch.randn(value.shape, generator=generator) * (2 / fan_in) ** 0.5)
        elif name.endswith("running_var") or name.endswith("weight"):
            value.uniform_(0.5, 1.5, generator=generator)
        else:
            value.uniform_(-0.2, 0.3, generator=generator)
    if isinstance(net.dense_head, AnchorHead):
        net.dense_head.conv_box.weight.data.mul_(0.2)
    return net.eval()


def grouped(points: np.ndarray, low, size, shape_xyz) -> dict[tuple[int, int, int], list[np.ndarray]]:
    """The points of each voxel by z, y, x, point by point."""
    inside: dict[tuple[int, int, int], list[np.ndarray]] = {}
    for point in points:
        x, y, z = np.floor((point[:3] - np.float32(low)) / np.float32(size)).astype(int).tolist()
        if all(0 <= place < count for place, count in zip((x, y, z), shape_xyz, strict=True)):
            inside.setdefault((z, y, x), []).append(point)
    return inside


def mean_voxels(points: np.ndarray, low, size, shape_xyz) -> tuple[torch.Tensor, torch.Tensor]:
    """Mean of the first five points (V, C) of each voxel and its batch entry, z, y, x."""
    inside = grouped(points, low, size, shape_xyz)
    means = np.array([np.mean(group[:5], axis=0) for group in inside.values()], np.float32)
    indices = torch.tensor([(0, *cell) for cell in inside], dtype=torch.int32).contiguous()
    return torch.from_numpy(means), indices


def padded_pillars(points: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    """The features (V, 32, 10) of the first 32 points of each pillar, and its cell (V, 2), y and x."""
    inside = grouped(points, (0.0, -39.68, -3.0), (0.16, 0.16, 4.0), (432, 496, 1))
    features, cells = np.zeros((len(inside), 32, 10), np.float32), []
    for row, ((_, y, x), group) in enumerate(inside.items()):
        used = np.array(group[:32])
        centre = [0.16 * (x + 0.5), -39.68 + 0.16 * (y + 0.5), -1.0]
        xyz = used[:, :3]
        features[row, : len(used)] = np.column_stack([used, xyz - xyz.mean(0), xyz - centre])
        cells.append((y, x))
    return torch.from_numpy(features), torch.tensor(cells)


def decode(scores: torch.Tensor, codes: torch.Tensor, directions: torch.Tensor) -> tuple[np.ndarray, ...]:
    """Every anchor's box (N, 7), score (N,) and label (N,) of second.yaml, one anchor at a time, in
    float64."""
    anchors = [
        (0 + 70.4 / 175 * ix, -40 + 80 / 199 * iy, bottom + height / 2, length, width, height, yaw)
        for iy in range(200)
        for ix in range(176)
        for length, width, height, bottom in ANCHORS
        for yaw in (0, 1.57)
    ]
    a, t = np.array(anchors), codes.double().numpy()
    diagonal = np.sqrt(a[:, 3] ** 2 + a[:, 4] ** 2)
    xy, z = t[:, :2] * diagonal[:, None] + a[:, :2], t[:, 2] * a[:, 5] + a[:, 2]
    size, yaw = np.exp(t[:, 3:6]) * a[:, 3:6], t[:, 6] + a[:, 6]
    turned = yaw - 0.78539 - np.floor((yaw - 0.78539) / np.pi) * np.pi
    yaw = turned + 0.78539 + np.pi * directions.argmax(1).numpy()
    probability = torch.sigmoid(scores.double()).numpy()
    boxes = np.column_stack([xy, z, size, yaw])
    return boxes, probability.max(1), probability.argmax(1)
