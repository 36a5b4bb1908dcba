"""A flipped bit in any file of what was shared."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

from advpipe.pipeline.dataset.layout import files
from advpipe.stages.verify.run import verify


def test_a_flipped_bit_in_any_file_is_found(shared: Path, tmp_path: Path) -> None:
    """The first byte, the last or any: of card, list, pictures, layouts, contracts, labels, reports, bags."""
    folder = Path(shutil.copytree(shared, tmp_path / "copy"))
    assert verify(folder, quick=True).is_good
    draws = random.Random(8)
    names = [name for name in files(folder) if (folder / name).stat().st_size]
    assert {"README.md", "SHA256SUMS", "play/foxglove.json", "fewer_points/labels.parquet"} <= set(names)
    for name in names:
        data = (folder / name).read_bytes()
        place = draws.choice((0, len(data) - 1, draws.randrange(len(data))))
        spoilt = bytearray(data)
        spoilt[place] ^= 1 << draws.randrange(8)
        (folder / name).write_bytes(spoilt)
        assert not verify(folder, quick=True).is_good, (name, place)
        (folder / name).write_bytes(data)
    assert verify(folder, quick=True).is_good
