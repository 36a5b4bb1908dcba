"""Measures `verify` relative to reading and hashing the same bytes, and whether it finds every flipped bit.

    python benchmarks/verify.py DATA_SET [--rounds 5] [--flips 1000] [--lone 300] [--full]

DATA_SET is left as it is: what the program needs of it is copied to a folder in memory. Exit code 1 where
`verify --quick` is below 0.8 of the rate of reading and hashing, or where a bit goes unseen.

--flips: single bits at random places of a shared data set, all its bytes alike; --lone: the same in the
clean bag without SHA256SUMS. So that a thousand flips take minutes, they are made in a data set of at most
`--flip-mb`: a larger one is cut down to its smallest bags, each with its files.
"""

from __future__ import annotations

import argparse
import hashlib
import resource
import shutil
import time
from pathlib import Path

import numpy as np
from common import compare, finish, machine, scratch

from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.dataset import checksums
from advpipe.pipeline.dataset.layout import files
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.stages.verify.run import verify

MARK = 0.8
BLOCK_BYTES = 1 << 18


def read_and_hash(folder: Path) -> None:
    """The bound: every byte is read once and goes through SHA-256."""
    block = memoryview(bytearray(BLOCK_BYTES))
    for name in files(folder):
        sha256 = hashlib.sha256()
        with (folder / name).open("rb", buffering=0) as stream:
            while length := stream.readinto(block):
                sha256.update(block[:length])


def time_quick(folder: Path, rounds: int) -> bool:
    megabytes = sum((folder / name).stat().st_size for name in files(folder)) / 1e6

    def quick() -> None:
        assert verify(folder, quick=True).is_good

    found = compare("verify --quick / read and hash", quick, lambda: read_and_hash(folder), rounds)
    print(found.line(megabytes, "MB/s", MARK))
    return found.ratio >= MARK


def time_full(folder: Path) -> bool:
    """The full check once: its time a frame, and the most memory that the process ever held."""
    clouds = sum(describe(path.parent).clouds for path in sorted(folder.glob("*/metadata.yaml")))
    before_mb = peak_mb()
    start_s = time.perf_counter()
    result = verify(folder)
    took_s = time.perf_counter() - start_s
    print(f"full check: {took_s:.1f} s for {clouds} clouds, {1000 * took_s / max(clouds, 1):.0f} ms each")
    print(f"peak memory {peak_mb():.0f} MB, before it {before_mb:.0f} MB; {len(result.findings)} findings")
    for finding in result.findings:
        print(f"  {finding}")
    return result.is_good


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def small_copy(source: Path, target: Path, limit_mb: float) -> Path:
    """A whole data set of at most so many megabytes: the clean bag, cut to its begin if it must be, and what
    is small enough beside it."""
    target.mkdir()
    left = limit_mb * 1e6
    for path in sorted(source.iterdir(), key=lambda path: (path.name != "clean", path.name)):
        size = path.stat().st_size if path.is_file() else sum(f.stat().st_size for f in path.rglob("*"))
        if size <= left and path.is_dir():
            shutil.copytree(path, target / path.name)
        elif size <= left and path.name not in checksums.UNLISTED:
            shutil.copy(path, target)
        elif path.name == "clean":
            size = cut(path, target / "clean", int(left))
        else:
            continue
        left -= size
    checksums.write(target)
    return target


def cut(bag: Path, out: Path, limit_bytes: int) -> int:
    """The first messages of a bag; returns the bytes of the file."""
    reader = BagReader(bag)
    with BagWriter(out, provenance={**reader.provenance, "recovered": "{}"}) as writer:
        total = 0
        raw: RawMessage
        for raw in reader.raw_messages():
            total += len(raw.cdr)
            if total > limit_bytes:
                break
            writer.copy(raw)
    return sum(path.stat().st_size for path in out.iterdir())


def flip_bits(folder: Path, count: int, quick: bool, label: str) -> bool:
    """Turns so many single bits over, one after the other, and counts those that verify finds."""
    rng = np.random.default_rng(1)
    paths = [folder / name for name in files(folder)]
    ends = np.cumsum([path.stat().st_size for path in paths])
    assert verify(folder, quick=quick).is_good, "the data set is damaged already"
    found, unseen = 0, []
    for place, bit in zip(
        rng.integers(ends[-1], size=count).tolist(), rng.integers(8, size=count).tolist(), strict=True
    ):
        index = int(np.searchsorted(ends, place, side="right"))
        path, offset = paths[index], place - int(ends[index - 1] if index else 0)
        flip(path, offset, bit)
        is_found = not verify(folder, quick=quick).is_good
        found += is_found
        unseen += [] if is_found else [f"{path.relative_to(folder)} at {offset}, bit {bit}"]
        flip(path, offset, bit)
    print(f"{label}: {found} of {count} flipped bits found, in {ends[-1] / 1e6:.1f} MB")
    for line in unseen:
        print(f"  unseen: {line}")
    return found == count


def flip(path: Path, offset: int, bit: int) -> None:
    """Turns a bit over in place."""
    with path.open("r+b") as stream:
        stream.seek(offset)
        (value,) = stream.read(1)
        stream.seek(offset)
        stream.write(bytes([value ^ 1 << bit]))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data_set", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--flips", type=int, default=1000)
    parser.add_argument("--lone", type=int, default=300, help="flips in each bag alone")
    parser.add_argument("--flip-mb", type=float, default=20.0)
    parser.add_argument("--full", action="store_true", help="time the full check, too")
    options = parser.parse_args()
    print(machine())
    passed = True
    with scratch() as folder:
        small = small_copy(options.data_set, Path(folder) / "small", options.flip_mb)
        passed &= flip_bits(small, options.flips, True, "shared data set")
        lone = {"lone bag": small / "clean"} if options.lone else {}
        lone |= {
            f"lone attack {path.parent.name}": path.parent for path in small.glob("*/attack.yaml") if lone
        }
        for label, bag in sorted(lone.items(), reverse=True):
            alone = Path(shutil.copytree(bag, Path(folder) / "alone" / bag.name))
            passed &= flip_bits(alone, options.lone, False, f"{label}, in full")
    if options.rounds:
        target = options.data_set
        if (target / checksums.FILE).is_file():
            passed &= time_quick(target, options.rounds)
        else:
            print(f"{target} has no {checksums.FILE}: `advpipe share` it for the rate")
    if options.full:
        passed &= time_full(options.data_set)
    finish(passed)


if __name__ == "__main__":
    main()
