"""Camera images: what their files say, and what attacks on them declare."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from advpipe.pipeline.audit.image_probes import IMAGE_PROBES, ImageFile, ImageView
from advpipe.pipeline.audit.implied import implied
from advpipe.pipeline.bag.provenance_record import RecordedAttack
from advpipe.pipeline.messages.compressed_image import StampedImage
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.declared import declaration_of

PERIOD_NS = 100_000_000
PROBE = {probe.name: probe for probe in IMAGE_PROBES}


def jpeg(seed: int, quality: int = 90) -> bytes:
    pixels = np.random.default_rng(seed).integers(0, 255, (24, 32, 3), np.uint8)
    written = io.BytesIO()
    Image.fromarray(pixels).save(written, "JPEG", quality=quality)
    return written.getvalue()


def view(*files: bytes, late_ns: int = 0) -> ImageView:
    """Images 100 ms apart, of which the last one arrives late."""
    found = []
    for number, file in enumerate(files):
        stamp_ns = (1 + number) * PERIOD_NS
        log_ns = stamp_ns + (late_ns if number == len(files) - 1 else 0)
        found.append(
            ImageFile.of(StampedImage(stamp_ns, "camera", "rgb8; jpeg compressed bgr8", file), log_ns)
        )
    return ImageView(found)


def values(name: str, seen: ImageView) -> list[float]:
    return PROBE[name].measure(seen).tolist()


def test_another_quality_and_the_same_file_again_are_seen() -> None:
    seen = view(jpeg(1), jpeg(2), jpeg(3, quality=40), jpeg(2))
    assert values("equal-files", seen) == [0, 1, 0, 1]
    step = values("step", seen)
    assert step[0] == step[1] < step[2]
    assert values("bytes", seen)[2] < min(map(len, (jpeg(1), jpeg(2))))
    assert values("compression", seen)[0] == pytest.approx(len(jpeg(1)) / (24 * 32))
    assert values("tables", seen) == [2.0] * 4


def test_a_late_image_is_seen_in_its_arrival_alone() -> None:
    seen = view(*map(jpeg, range(5)), late_ns=30_000_000)
    assert values("log-time", seen) == pytest.approx([0, 0, 0, 0, 0.03])
    assert values("arrival", seen)[1:] == pytest.approx([0, 0, 0, 0.03])
    assert values("interval", seen)[1:] == [0.0] * 4


def test_what_is_no_picture_has_its_bytes_alone() -> None:
    seen = view(jpeg(1), b"no picture")
    assert values("bytes", seen)[1] == 10
    assert all(np.isnan(values(name, seen)[1]) for name in ("step", "header", "sampling", "compression"))


@pytest.mark.parametrize(
    ("attack", "probe", "expected"),
    [
        ("camera-freeze", "equal-files", "camera-freeze does not bound the images that show another moment"),
        ("camera-freeze", "step", ""),
        ("camera-freeze", "log-time", ""),
        ("camera-delay", "log-time", "camera-delay declares delay of an image (image_delay_s) of up to 0.5"),
        ("camera-delay", "bytes", ""),
        ("camera-blind", "bytes", "camera-blind"),
        ("camera-blind", "step", ""),
        ("camera-blind", "arrival", ""),
    ],
)
def test_the_reason(attack: str, probe: str, expected: str) -> None:
    spec = attack_spec({"type": attack, "victim": "ego"})
    recorded = RecordedAttack(type=attack, declared=declaration_of(spec))
    found = implied(PROBE[probe], [recorded], has_debug=False)
    assert found.startswith(expected)
    assert bool(found) == bool(expected)
