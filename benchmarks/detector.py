"""Seconds a frame of the detectors against the floor: their FLOPs at the rate of bare matrix products.

The floor of a step, forward and backward to the points, is 2 x the FLOPs of a forward pass over the best
rate that torch.mm of large square matrices reached in the same run. Dense convolutions may run faster than
torch.mm (on AMD's processors, twice as fast), so their best rate stands beside it. FLOPs are PyTorch's own
count. Everything is timed in turns, so that whatever else the machine does weighs on all. On the CPU one
thread computes, as in advpipe; random weights take as long as trained ones.

    python benchmarks/detector.py [BAG] [--rounds 9] [--frames 4] [--presets second/small pointpillars/kitti]
    python benchmarks/detector.py [BAG] --device cuda [--batches 1 2 4 8 16]

BAG is a recorded drive; by default two seconds of the boulevard are simulated. `spconv` is timed too where
it is installed: its sparse part, forward, on one thread (two give wrong results on a CPU, and its backward
needs a GPU). On a GPU there is no floor: seconds and frames a second by the number of clouds in a batch, for
the step and for detection with everything up to the boxes, and the GPU's memory at its peak.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any
from unittest.mock import patch

import torch
from common import machine
from torch import Tensor, nn
from torch.nn import functional as F
from torch.utils.flop_counter import FlopCounterMode

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common import sparse_compiled
from advpipe.pipeline.detector.common.backbone3d import STRIDED
from advpipe.pipeline.detector.common.sparse_network import SparseNetwork
from advpipe.pipeline.detector.common.voxel_detector import VoxelNetworkDetector
from advpipe.pipeline.detector.common.voxel_network import VoxelNetwork
from advpipe.pipeline.detector.common.voxels import Voxels
from advpipe.pipeline.detector.device import open_device
from advpipe.pipeline.detector.families import family_named
from advpipe.pipeline.detector.threads import TORCH_THREADS
from advpipe.pipeline.messages.cloud import xyzi
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate

REACH = {
    "second/small": 2.0,
    "second/360": 1.3,
    "second/kitti": 1.3,
    "pointpillars/small": 2.0,
    "pointpillars/kitti": 1.3,
    "centerpoint/small": 2.0,
    "centerpoint/waymo": 1.3,
}
"""How many times the floor a step may take, by family and preset."""

Net = VoxelNetwork[Any, Any]


def network(name: str) -> Net:
    torch.manual_seed(0)
    family, preset = name.split("/")
    net: Any = family_named(family).network(preset).eval().requires_grad_(False)
    return net  # type: ignore[no-any-return]


def forward(net: Net, *clouds: Tensor) -> Tensor:
    """Clouds to raw predictions, rules included."""
    out = net(net.voxels(clouds))
    parts = [getattr(out, field.name) for field in fields(out)]
    return torch.stack([part.sum() for part in parts if part is not None]).sum()


def step(net: Net, *clouds: Tensor) -> tuple[Tensor, ...]:
    """The gradient to the points: what one step of an attack takes."""
    leaves = [points.clone().requires_grad_() for points in clouds]
    return torch.autograd.grad(forward(net, *leaves), leaves)


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def flops(net: Net, points: Tensor) -> float:
    """Of the matrix products and convolutions of a forward pass, as PyTorch counts its own: it does not see
    those of compiled kernels."""
    in_pytorch = patch.object(sparse_compiled, "is_compiled", lambda: False)
    with in_pytorch, FlopCounterMode(display=False) as counter, torch.no_grad():
        forward(net, points)
    return float(counter.get_total_flops())


def gemm(size: int) -> tuple[float, Callable[[], object]]:
    a = torch.randn(size, size)
    return 2.0 * size**3, lambda: a @ a


def convolution() -> tuple[float, Callable[[], object]]:
    x = torch.randn(1, 256, 64, 64).to(memory_format=torch.channels_last)
    weight = torch.randn(256, 256, 3, 3).to(memory_format=torch.channels_last)
    return 2.0 * 64 * 64 * 256 * 256 * 9, lambda: F.conv2d(x, weight, padding=1)


def spconv_backbone(net: Net) -> Callable[[Voxels], Tensor] | None:
    """The sparse backbone of the network out of spconv's modules; None where spconv is not installed, or the
    network has none."""
    if not isinstance(net, SparseNetwork):
        return None
    try:
        import spconv.pytorch as spconv
        from spconv.core import ConvAlgo
    except ImportError:
        return None
    ours = net.backbone3d
    stages = [list(ours.stage1), list(ours.stage2), list(ours.stage3), list(ours.stage4), [ours.fold]]
    layers: list[nn.Module] = []
    for number, stage in enumerate(stages):
        for place, layer in enumerate(stage):
            c_in, c_out = layer.weight.shape[1:]
            if number and not place:
                kernel, stride, padding = STRIDED[number - 1]
                made = spconv.SparseConv3d(
                    c_in,
                    c_out,
                    kernel,
                    stride,
                    padding,
                    bias=False,
                    algo=ConvAlgo.Native,
                    indice_key=f"d{number}",
                )
            else:
                kernel = (3, 3, 3)
                made = spconv.SubMConv3d(
                    c_in, c_out, kernel, padding=1, bias=False, algo=ConvAlgo.Native, indice_key=f"s{number}"
                )
            weight = layer.weight.view(*kernel, c_in, c_out).permute(4, 0, 1, 2, 3)
            made.weight.data.copy_(weight)
            layers.append(spconv.SparseSequential(made, layer.norm, nn.ReLU()))
    chain = spconv.SparseSequential(*layers).eval().requires_grad_(False)

    def run(voxels: Voxels) -> Tensor:
        sites = voxels.sites
        indices = torch.stack(sites.bzyx(), 1).int().contiguous()
        features = net.inputs(voxels)
        dense: Tensor = chain(spconv.SparseConvTensor(features, indices, list(sites.shape), 1)).dense()
        return dense.transpose(1, 2).flatten(1, 2)

    return run


def peak_memory_mb(preset: str, bag: Path, work: str) -> tuple[float, float]:
    """Resident memory of a fresh process before the work and at its peak, in MB."""
    command = [sys.executable, __file__, str(bag), "--memory", preset, work]
    before, peak = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return float(before), float(peak)


def clouds(bag: Path, count: int) -> list[Tensor]:
    made = []
    for frame in read_frames(bag, FrameSlice.parse("::5")):
        points = torch.from_numpy(xyzi(frame.cloud))
        points = points[torch.isfinite(points).all(1)]
        made.append(points)
        if len(made) == count:
            break
    return made


def report(name: str, points: list[Tensor], rounds: int, bag: Path) -> bool:
    """The lines of one preset; whether the step is within its reach of the floor."""
    net = network(name)
    gemms, (conv_flops, conv) = [gemm(1024), gemm(1536)], convolution()
    work = statistics.mean(flops(net, cloud) for cloud in points)
    peer = spconv_backbone(net)
    if peer is not None:
        voxels = net.voxels(points[:1])
        theirs, ours = peer(voxels), net.bird_eye(voxels, None)
        if not torch.allclose(theirs, ours, rtol=1e-3, atol=1e-3):
            raise SystemExit(f"spconv computes something else: {float((theirs - ours).abs().max())}")
    times: dict[str, list[float]] = {}
    rate = conv_rate = 0.0

    def note(what: str, value: float, number: int) -> None:
        if number:  # the first round warms up
            times.setdefault(what, []).append(value)

    for number in range(rounds + 1):
        cloud = points[number % len(points)]
        for count, product in gemms:
            rate = max(rate, count / seconds(product))
        conv_rate = max(conv_rate, conv_flops / seconds(conv))
        with torch.no_grad():
            note("forward", seconds(lambda: forward(net, cloud)), number)  # noqa: B023
            voxels = net.voxels([cloud])
            note("voxels to map", seconds(lambda: net.bird_eye(voxels, None)), number)  # noqa: B023
            if peer is not None:
                note("the same by spconv", seconds(lambda: peer(voxels)), number)  # noqa: B023
        note("forward and backward", seconds(lambda: step(net, cloud)), number)  # noqa: B023
    floor_s = 2 * work / rate
    best_s = min(times["forward and backward"])
    ratio = best_s / floor_s
    print(
        f"\n{name}: {sum(p.numel() for p in net.parameters()):,} parameters, {len(voxels.sites):,} voxels, "
        f"{work / 1e9:.1f} GFLOP forward; "
        f"at best GEMM {rate / 1e9:.0f} GFLOP/s, convolution {conv_rate / 1e9:.0f} GFLOP/s"
    )
    for what, values in times.items():
        print(f"  {what:<24} best {min(values):7.3f} s, median {statistics.median(values):7.3f} s")
    verdict = "ok" if ratio <= REACH[name] else "MISSED"
    print(
        f"  floor of a step {floor_s:.3f} s: x {ratio:.2f}, asked x {REACH[name]:.1f} {verdict} "
        f"(at the rate of convolutions x {ratio * conv_rate / rate:.2f})"
    )
    if Path("/proc/self/status").exists():
        for kind in ("forward", "step"):
            before, peak = peak_memory_mb(name, bag, kind)
            print(f"  peak memory, {kind:<8} {peak:6,.0f} MB, {before:,.0f} MB of them before it (libraries)")
    return ratio <= REACH[name]


def report_batches(
    name: str, points: Sequence[Tensor], rounds: int, device: torch.device, batches: Sequence[int]
) -> None:
    """The lines of one preset on a GPU, where each work ends when its results have come back."""
    detector = VoxelNetworkDetector(network(name).to(device))
    print(f"\n{name}: {sum(p.numel() for p in detector.net.parameters()):,} parameters")
    for size in batches:
        batch = [points[place % len(points)].to(device) for place in range(size)]
        works: dict[str, Callable[[], object]] = {
            "forward and backward": lambda: [each.cpu() for each in step(detector.net, *batch)],  # noqa: B023
            "detection": lambda: detector.detect_batch(batch),  # noqa: B023
        }
        for what, work in works.items():
            if device.type == "cuda":
                torch.cuda.reset_peak_memory_stats(device)
            times = [seconds(work) for _ in range(rounds + 1)][1:]  # the first round warms up
            peak = torch.cuda.max_memory_allocated(device) / 1e6 if device.type == "cuda" else float("nan")
            median = statistics.median(times)
            print(
                f"  {what:<20} of {size:>2}: best {min(times):7.4f} s, median {median:7.4f} s, "
                f"{size / median:7.1f} frames/s, peak memory {peak:7,.0f} MB"
            )


def memory_mb(line: str) -> float:
    """Resident memory of this process: VmRSS now, VmHWM at its peak. (ru_maxrss counts the parent's too.)"""
    text = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(text.split(f"{line}:")[1].split()[0]) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bag", nargs="?", type=Path)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--frames", type=int, default=4)
    parser.add_argument("--presets", nargs="+", choices=list(REACH), default=list(REACH))
    parser.add_argument("--device", default="cpu", help="cpu, cuda or cuda:N")
    parser.add_argument("--batches", nargs="+", type=int, default=[1, 2, 4, 8, 16], help="on a GPU")
    parser.add_argument("--memory", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    try:
        device = open_device(given.device)
    except AdvpipeError as error:
        sys.exit(str(error))
    torch.set_num_threads(TORCH_THREADS)
    if given.memory:
        preset, work = given.memory
        net, points = network(preset), clouds(resolve_bag(given.bag), 1)[0]
        before = memory_mb("VmRSS")
        if work == "step":
            step(net, points)
        else:
            with torch.no_grad():
                forward(net, points)
        print(before, memory_mb("VmHWM"))
        return
    with tempfile.TemporaryDirectory() as folder:
        bag = given.bag
        if bag is None:
            bag = Path(folder) / "boulevard"
            simulate(load_scenario("boulevard", ["simulation.duration_s=2"]), bag)
        bag = resolve_bag(bag)
        points = clouds(bag, given.frames)
        on_gpu = device.type == "cuda"
        where = torch.cuda.get_device_name(device) if on_gpu else "one thread"
        print(f"{machine()}; PyTorch {torch.__version__}, {where}; {len(points)} clouds")
        if on_gpu:
            for name in given.presets:
                report_batches(name, points, given.rounds, device, given.batches)
            return
        passed = [report(name, points, given.rounds, bag) for name in given.presets]
    sys.exit(0 if all(passed) else 1)


if __name__ == "__main__":
    main()
