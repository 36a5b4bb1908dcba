"""A program: reads so many random mutations of bags in all ways; ends with a traceback for a wrong error."""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.verify.run import verify

LONGEST_S = 60
"""Of processor time, for one mutation read in one way."""


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    place = int(rng.integers(len(data)))
    kind = rng.integers(5)
    if kind == 0:
        return data[:place]
    if kind == 1:
        return data[:place] + bytes([data[place] ^ 1 << int(rng.integers(8))]) + data[place + 1 :]
    if kind == 2:  # lengths and places of any size
        number = int(rng.integers(2**63)) >> int(rng.integers(63))
        return data[:place] + number.to_bytes(8, "little") + data[place + 8 :]
    if kind == 3:  # a piece goes, or comes twice
        length = int(rng.integers(1, 200))
        return data[:place] + data[place : place + length] * int(rng.integers(2) * 2) + data[place + length :]
    return data[:place] + rng.bytes(int(rng.integers(1, 40))) + data[place + 20 :]


def refuse(path: Path) -> bool:
    """Whether verifying finds anything."""
    return not verify(path).is_good


def main() -> None:
    count, bags = int(sys.argv[1]), [Path(name) for name in sys.argv[2:]]
    rng = np.random.default_rng(3)
    good = refused = 0
    for number in range(count):
        bag = bags[number % len(bags)]
        with tempfile.TemporaryDirectory() as scratch:
            copy = Path(shutil.copytree(bag, Path(scratch) / bag.name))
            victims = sorted(copy.iterdir(), key=lambda path: path.suffix)
            victim = victims[number // len(bags) % 8 == 0]  # one in eight is metadata.yaml
            victim.write_bytes(mutate(victim.read_bytes(), rng))
            for read in (describe, refuse, lambda path: [*read_frames(path)]):
                start_s = time.process_time()
                try:
                    refused_it = read(copy) is True
                except AdvpipeError:
                    refused_it = True
                good, refused = good + (not refused_it), refused + refused_it
                assert time.process_time() - start_s < LONGEST_S, (number, read)
    print(good, refused)


if __name__ == "__main__":
    main()
