"""The files that sharing adds to a data set, except checksums and signature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from advpipe.pipeline.bag.v2x_picture import draw_bag
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.dataset.layout import CARD_NAME, Layout
from advpipe.pipeline.viewer_layouts.files import layout_texts
from advpipe.stages.share import names
from advpipe.stages.share.baglint_spec import baglint_spec
from advpipe.stages.share.card import write_card
from advpipe.stages.share.facts import BagFacts
from advpipe.stages.share.options import ShareOptions
from advpipe.stages.share.pictures import SharedPicture, draw_attack, draw_clean
from advpipe.stages.share.tracecheck_contract import tracecheck_contract

_OWN_PACKAGE = "advpipe_msgs/"


def write_additions(
    made: Path,
    name: str,
    found: Layout,
    bags: Sequence[BagFacts],
    sums: Mapping[str, str],
    sha256_of_bags: Mapping[str, str],
    options: ShareOptions,
    warnings: Sequence[str],
) -> None:
    """Write all additions into the folder `made`. bags: the clean one first. sha256_of_bags: by the bag's
    name."""
    clean = bags[0]
    for folder in (names.CHECKS, names.PLAY):
        (made / folder).mkdir()
    for bag in bags:
        title = f"{name}/{bag.path.name}"
        (made / names.baglint_name(bag.path.name)).write_text(baglint_spec(bag), encoding="utf-8")
        (made / names.tracecheck_name(bag.path.name)).write_text(
            tracecheck_contract(bag, title), encoding="utf-8"
        )
    for file_name, text in layout_texts(clean.path).items():
        (made / names.PLAY / file_name).write_text(text, encoding="utf-8")
    if any(topic.type.startswith(_OWN_PACKAGE) for topic in clean.topics.values()):
        _write_messages(made / names.MESSAGES / _OWN_PACKAGE)
    drives = {sha256_of_bags[bag.path.name]: bag for bag in bags if not bag.is_attack}
    pictures = _draw(bags, drives, made / names.FIGURES)
    text = write_card(name, found, bags, sums, drives, options, warnings, pictures)
    (made / CARD_NAME).write_text(text, encoding="utf-8")


def _write_messages(folder: Path) -> None:
    """Write the ROS 2 package of our message types, for colcon to build."""
    source = files("advpipe.pipeline.messages.msgs")
    (folder / "msg").mkdir(parents=True)
    for file in (source / "CMakeLists.txt", source / "package.xml"):
        (folder / file.name).write_bytes(file.read_bytes())
    for file in (source / "msg").iterdir():
        if file.name.endswith(".msg"):
            (folder / "msg" / file.name).write_bytes(file.read_bytes())


def _draw(bags: Sequence[BagFacts], drives: Mapping[str, BagFacts], folder: Path) -> list[SharedPicture]:
    """Draw the clouds of the first LiDAR by name, and V2X if there is any. drives: by SHA-256."""
    folder.mkdir()
    clean = bags[0]
    pictures: list[SharedPicture] = []
    if clean.lidars:
        topic = clean.lidars[0].name
        pictures.append(draw_clean(clean.path, topic, folder))
        for bag in track([bag for bag in bags if bag.is_attack], "drawing"):
            parent = drives.get(bag.provenance.fields.parent_sha256 or "", clean)
            if all(any(lidar.name == topic for lidar in candidate.lidars) for candidate in (bag, parent)):
                picture = draw_attack(parent.path, bag.path, topic, folder)
                pictures += [picture] if picture else []
    if clean.description.v2x is not None:
        draw_bag(clean.path, folder / "v2x.png")
        pictures.append(
            SharedPicture("v2x.png", "The clean drive's V2X: CAM rates, delivery by distance, load.")
        )
    return pictures
