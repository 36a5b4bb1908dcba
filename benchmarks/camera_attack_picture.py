"""Draws the same moment of a camera clean, with a patch, and blinded, side by side.

    python benchmarks/camera_attack_picture.py DATASET IMAGE PICTURE [--bags BAG ...] [--camera front]

docs/images/camera-attacks.jpg is of these commands:

    advpipe simulate boulevard --out datasets/picture --set simulation.seed=2 --set simulation.duration_s=2 \
        --set simulation.warmup_s=24 --set simulation.start=2026-06-21T10:00:00Z \
        --set 'sensors.cameras={front: {preset: front, images: [rgb, depth, instance_segmentation]}}'
    advpipe attack datasets/picture --type camera-patch --out datasets/picture/patch
    advpipe attack datasets/picture --type camera-patch --set pattern=random --out datasets/picture/random
    advpipe attack datasets/picture --type camera-blind --out datasets/picture/blind
    python benchmarks/camera_attack_picture.py datasets/picture 10 docs/images/camera-attacks.jpg
"""

from __future__ import annotations

import argparse
import io
from itertools import islice
from pathlib import Path

from PIL import Image

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_cameras import cameras_of
from advpipe.pipeline.messages.compressed_image import image_from_cdr, pixels_of

WIDTH, QUALITY = 480, 80


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("image", type=int, help="counted from 0")
    parser.add_argument("picture", type=Path)
    parser.add_argument("--bags", nargs="+", default=["patch", "random", "blind"])
    parser.add_argument("--camera", default="front")
    options = parser.parse_args()
    panels = [_panel(options.dataset / bag, options.camera, options.image) for bag in options.bags]
    whole = Image.new("RGB", (WIDTH * len(panels), panels[0].height))
    for place, panel in enumerate(panels):
        whole.paste(panel, (place * WIDTH, 0))
    file = io.BytesIO()
    whole.save(file, "JPEG", quality=QUALITY)
    options.picture.write_bytes(file.getvalue())
    print(f"{options.picture}: {len(file.getvalue()) / 1000:.0f} kB")


def _panel(bag: Path, camera: str, number: int) -> Image.Image:
    """One image of a bag, smaller."""
    reader = BagReader(bag)
    (topic,) = [each.image_topic for each in cameras_of(reader) if each.name == camera]
    raw = next(islice(reader.raw_messages([topic]), number, None))
    image = Image.fromarray(pixels_of(image_from_cdr(raw.cdr).file))
    return image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    main()
