"""Measures how fast a data set is packed and unpacked, and whether every flipped bit of an archive is found.

    python benchmarks/archive.py [--megabytes 500] [--rounds 5] [--flips 1000]

Beside it: the same bytes read, hashed and written, once each way. Exit code 1 below 0.8 of that, and where a
flipped bit goes unseen.
"""

from __future__ import annotations

import argparse
import hashlib
import random
import shutil
from pathlib import Path

from common import compare, finish, machine, scratch

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.dataset import checksums
from advpipe.pipeline.dataset.archive import contents, pack, unpack_archive

MARK = 0.8
BLOCK_BYTES = 1 << 20


def hash_and_copy(sources: list[Path], target: Path, hashes: int) -> None:
    """Read, hash so many times and write: the least that packing (file and part) or unpacking can do."""
    digests = [hashlib.sha256() for _ in range(hashes)]
    with target.open("wb") as out:
        for source in sources:
            with source.open("rb") as stream:
                while block := stream.read(BLOCK_BYTES):
                    for digest in digests:
                        digest.update(block)
                    out.write(block)


def make_set(folder: Path, megabytes: int) -> None:
    draws = random.Random(1)
    (folder / "clean").mkdir(parents=True)
    for number in range(4):
        with (folder / "clean" / f"{number}.mcap").open("wb") as out:
            for _ in range(megabytes // 4):
                out.write(draws.randbytes(1_000_000))
    (folder / "README.md").write_text("a data set\n", encoding="utf-8")
    checksums.write(folder)


def count_found(folder: Path, flips: int) -> int:
    """How many of a number of single bits, flipped at random offsets of an archive, unpacking detects."""
    folder.mkdir()
    small = folder / "small"
    make_set(small, 4)
    archive = pack(contents(small), folder / "flips.tar")[0]
    size_bytes, draws, found = archive.stat().st_size, random.Random(2), 0
    for _ in range(flips):
        place, mask = draws.randrange(size_bytes), 1 << draws.randrange(8)
        flip(archive, place, mask)
        try:
            shutil.rmtree(unpack_archive(archive, folder / "out"))
        except AdvpipeError:
            found += 1
        flip(archive, place, mask)
    return found


def flip(path: Path, place: int, mask: int) -> None:
    with path.open("r+b") as stream:
        stream.seek(place)
        byte = stream.read(1)[0]
        stream.seek(place)
        stream.write(bytes([byte ^ mask]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--megabytes", type=int, default=500)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--flips", type=int, default=1000)
    arguments = parser.parse_args()
    print(machine())
    is_good = True
    with scratch() as scratch_folder:
        folder = Path(scratch_folder)
        source, archive, copy, out = folder / "set", folder / "set.tar", folder / "copy", folder / "out"
        make_set(source, arguments.megabytes)
        files = [path for path in source.rglob("*") if path.is_file()]
        packing = compare(
            "pack",
            lambda: pack(contents(source), archive, overwrite=True),
            lambda: hash_and_copy(files, copy, hashes=2),
            arguments.rounds,
        )
        unpacking = compare(
            "unpack",
            lambda: unpack_archive(archive, out),
            lambda: hash_and_copy([archive], copy, hashes=2),
            arguments.rounds,
            tidy=lambda: shutil.rmtree(out, ignore_errors=True),
        )
        for each in (packing, unpacking):
            print(each.line(arguments.megabytes, "MB/s", MARK))
            is_good &= each.ratio >= MARK
        found = count_found(folder / "flips", arguments.flips)
        print(f"{found} of {arguments.flips} flipped bits found")
    finish(is_good and found == arguments.flips)


if __name__ == "__main__":
    main()
