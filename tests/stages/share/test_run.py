"""What sharing makes, checked by tools of others, and what it refuses."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from rosbags.rosbag2 import StoragePlugin, Writer

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.dataset import checksums, signature
from advpipe.pipeline.dataset.archive import contents, unpack_archive
from advpipe.pipeline.messages.types import message_class, serialise, typestore
from advpipe.stages.share.options import citation_text
from advpipe.stages.share.run import ShareOptions, share

BAGS = ("clean", "false_speed", "fewer_points")
BIN = Path(sys.executable).parent


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {name: path.read_bytes() for name, path in contents(folder).items()}


def test_all_recorded_files_are_copied_unchanged(recorded: Path, shared: Path) -> None:
    found = bytes_of(shared)
    assert found.items() >= bytes_of(recorded).items()
    added = {"README.md", "SHA256SUMS", "play/foxglove.json", "play/scene.rviz", "figures/clean.png"}
    added |= {f"checks/{bag}.{kind}" for bag in BAGS for kind in ("baglint.yaml", "tracecheck.json")}
    assert added < set(found)
    assert {"figures/fewer_points.png", "figures/v2x.png", "msgs/advpipe_msgs/package.xml"} < set(found)
    sums = checksums.read(shared)
    assert sums == {name: sha256_of(shared / name) for name in found if name != "SHA256SUMS"}


@pytest.mark.oracle
@pytest.mark.parametrize("bag", BAGS)
def test_baglint_accepts_the_bag_and_rejects_changed_ones(shared: Path, bag: str) -> None:
    pytest.importorskip("baglint")
    (mcap,) = (shared / bag).glob("*.mcap")

    def lint(spec: str) -> subprocess.CompletedProcess[str]:
        arguments = [BIN / "baglint", "--strict", mcap, "--spec", shared / "checks" / spec]
        return subprocess.run(arguments, capture_output=True, text=True, check=False)

    result = lint(f"{bag}.baglint.yaml")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "no findings" in result.stdout
    spec = yaml.safe_load((shared / "checks" / f"{bag}.baglint.yaml").read_text(encoding="utf-8"))
    assert set(spec["topics"]) == {
        n for n, i in BagReader(shared / bag, debug=True).topics.items() if i.count
    }
    assert ["map", "ego/lidar"] in spec["transforms"]["required"]
    if bag == "fewer_points":  # two frames of ten
        assert lint("clean.baglint.yaml").returncode == 1


@pytest.mark.oracle
@pytest.mark.parametrize("bag", BAGS)
def test_tracecheck_accepts_the_bag_and_rejects_changed_ones(shared: Path, tmp_path: Path, bag: str) -> None:
    pytest.importorskip("tracecheck")

    def check(contract: str) -> dict[str, object]:
        out = tmp_path / contract
        arguments = [BIN / "tracecheck", "check", shared / bag, "--contract", shared / "checks" / contract]
        subprocess.run([*arguments, "--out", out, "--quiet"], capture_output=True, check=False)
        report: dict[str, object] = json.loads((out / "report.json").read_text(encoding="utf-8"))
        return report

    report = check(f"{bag}.tracecheck.json")
    assert report["overall"] == "pass"
    assert report["status_counts"]["warn"] == 0  # type: ignore[index]
    others = "false_speed" if bag == "clean" else "clean"
    assert check(f"{others}.tracecheck.json")["overall"] == "fail"


def card_of(folder: Path) -> str:
    return (folder / "README.md").read_text(encoding="utf-8")


def test_the_card_describes_the_bags(recorded: Path, shared: Path) -> None:
    card = card_of(shared)
    front = yaml.safe_load(card.split("---")[1])
    assert front["license"] == "cc-by-4.0"
    assert {"lidar", "v2x", "adversarial-attacks"} <= set(front["tags"])
    reader = BagReader(shared / "clean")
    for name, info in reader.topics.items():
        if info.count:
            assert f"| `{name}` | {info.type.replace('/msg/', '/')} | {info.count:,} |" in card
    assert "| `/ego/imu` | sensor_msgs/Imu | 90 | 100.0 Hz | ego/imu |" in card
    assert "| `lidar` | ego | 16 | 72,000 | 10.0 | 100.0 m | 0.0, 0.0, 1.8 m |" in card
    assert "| LiDAR | `lidar` | ego | `/ego/lidar/points` |" in card
    assert "| GNSS receiver |  | ego | `/ego/gnss/fix` |" in card
    assert "| IMU |  | ego | `/ego/imu` |" in card
    assert "| wheel odometry |  | ego | `/ego/" in card
    assert f"| map's SHA-256 | {reader.provenance['map_sha256']} |" in card
    assert sha256_of(next((shared / "clean").glob("*.mcap"))) in card
    row = json.loads((recorded / "reports" / "small" / "report.json").read_text())["rows"][0]
    assert f"| {row['lost_objects']} of {row['objects_found_clean']} | {row['working_score']:.2f} |" in card
    assert "| objects lost, loose overlap | score at least |" in card
    assert f"| {row['working_score']:.2f} | {row['chamfer_distance_m2']:.4f} |" in card
    # the boulevard is among the maps that `small` was trained on
    banner = "> **Training map: the detector small was trained on drives on this map."
    assert card.index(banner) < card.index("## Contents")
    assert "| detach, recipe random |" in card
    assert "| attackers' share 0.5, from_s 0.0, kind continuous |" in card
    assert "### Effect on V2X (small)" in card
    assert "A. Author, 2026" in card
    assert str(recorded) not in card
    for link in re.findall(r"\]\(([^)#]+)\)", card):
        assert link.startswith("https://") or (shared / link).exists(), link


def test_the_cards_python_reads_the_clouds(shared: Path) -> None:
    (program,) = re.findall(r"```python\n(.*?)```", card_of(shared), flags=re.DOTALL)
    run = subprocess.run([sys.executable, "-c", program], cwd=shared, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    reader = BagReader(shared / "clean")
    expected = [
        f"{raw.log_time_ns} {len(reader.cloud(raw).cloud)} {reader.cloud(raw).cloud['x'].mean()!s}"
        for raw in reader.raw_messages(["/ego/lidar/points"])
    ]
    assert run.stdout.splitlines() == expected


def test_layouts_name_existing_topics_and_frames(shared: Path) -> None:
    topics = BagReader(shared / "clean").topics
    layout = json.loads((shared / "play" / "foxglove.json").read_text(encoding="utf-8"))
    scene = layout["configById"]["3D!scene"]
    assert {"/ego/lidar/points", "/ego/markers"} <= set(scene["topics"]) < set(topics)
    assert scene["followTf"] == "ego/base_link"
    assert set(re.findall(r'"(\w+!\w+)"', json.dumps(layout["layout"]))) == set(layout["configById"])
    (path,) = layout["configById"]["Plot!speed"]["paths"]
    assert path["value"].split(".")[0] in topics
    rviz = yaml.safe_load((shared / "play" / "scene.rviz").read_text(encoding="utf-8"))[
        "Visualization Manager"
    ]
    assert rviz["Global Options"]["Fixed Frame"] == "map"
    shown = [display["Topic"] for display in rviz["Displays"] if "Topic" in display]
    names = {topic["Value"] for topic in shown}
    assert {"/ego/lidar/points", "/ego/markers", "/ego/odometry"} <= names < set(topics)
    for topic in shown:
        (qos,) = topics[topic["Value"]].qos
        assert topic["Durability Policy"].replace(" ", "_").upper() == qos.durability.name


def test_an_archive_in_signed_parts_comes_back_whole(recorded: Path, tmp_path: Path) -> None:
    key = tmp_path / "key.pem"
    cryptography = pytest.importorskip("cryptography.hazmat.primitives.asymmetric.ed25519")
    serialization = pytest.importorskip("cryptography.hazmat.primitives.serialization")
    key.write_bytes(
        cryptography.Ed25519PrivateKey.generate().private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
    )
    options = ShareOptions(sign=key, split_size_bytes=200_000)
    made = share(recorded, tmp_path / "tiny.tar", options).made
    assert [path.name for path in made[:2]] == ["tiny.tar.000", "tiny.tar.001"]
    again = share(recorded, tmp_path / "b" / "tiny.tar", options).made
    assert [path.read_bytes() for path in made] == [path.read_bytes() for path in again]
    folder = unpack_archive(made[0])
    assert folder == tmp_path / "tiny"
    signature.verify_signature(folder)
    assert "openssl pkeyutl -verify" in card_of(folder)
    place = next(part for part in made if b"SHA256SUMS.sig" in part.read_bytes())
    data = bytearray(place.read_bytes())
    data[data.index(b"tiny/SHA256SUMS.sig") + 512] ^= 1
    place.write_bytes(data)
    (tmp_path / "tiny.tar.sha256").unlink()
    with pytest.raises(AdvpipeError, match="does not sign SHA256SUMS"):
        unpack_archive(made[0], tmp_path / "damaged")
    assert bytes_of(folder).items() >= bytes_of(recorded).items()


def test_sharing_again_replaces_generated_files_and_keeps_the_authors_text(
    shared: Path, dataset: Path, tmp_path: Path
) -> None:
    options = ShareOptions(licence="CC-BY-4.0", citation="A. Author, 2026")
    share(shared, tmp_path / "tiny", options)
    assert bytes_of(tmp_path / "tiny") == bytes_of(shared)
    (dataset / "README.md").write_text("Recorded on a rainy day.", encoding="utf-8")
    (dataset / ".DS_Store").write_text("x")
    with pytest.raises(AdvpipeError, match="tiny already exists"):
        share(dataset, tmp_path / "tiny", options)
    share(dataset, tmp_path / "tiny", ShareOptions(licence="CC-BY-4.0", overwrite=True))
    assert "## From its author\n\nRecorded on a rainy day." in card_of(tmp_path / "tiny")
    assert not (tmp_path / "tiny" / ".DS_Store").exists()
    (tmp_path / "mine").mkdir()
    with pytest.raises(AdvpipeError, match="mine is not a shared data set"):
        share(dataset, tmp_path / "mine", ShareOptions(overwrite=True))


def test_a_bag_of_another_parent_is_refused(dataset: Path, tmp_path: Path) -> None:
    clean = dataset / "clean"
    shutil.rmtree(clean)
    write_foreign(clean)
    with pytest.raises(AdvpipeError, match="false_speed was made from another bag"):
        share(dataset, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def write_foreign(path: Path) -> None:
    with Writer(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/talk", "std_msgs/msg/String", typestore=typestore())
        message = message_class("std_msgs/msg/String")(data="hello")
        for stamp_ns in (1, 2):
            writer.write(connection, stamp_ns, serialise(message, "std_msgs/msg/String"))


def test_another_tools_bag_is_shared(tmp_path: Path) -> None:
    write_foreign(tmp_path / "theirs" / "clean")
    summary = share(tmp_path / "theirs", tmp_path / "out")
    assert any("no licence is stated" in warning for warning in summary.warnings)
    assert any("clean has no chunk checksums" in warning for warning in summary.warnings)
    card = card_of(tmp_path / "out")
    assert "another tool than advpipe" in card
    assert "simulated" not in card.split("## Notes")[0]
    assert "| `/talk` | std_msgs/String | 2 |" in card


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("figures/own.png", "a name that shared data sets reserve"),
        ("checks/metadata.yaml", "a name that shared data sets reserve"),
    ],
)
def test_reserved_names_are_refused(dataset: Path, tmp_path: Path, path: str, message: str) -> None:
    (dataset / path).parent.mkdir(parents=True)
    (dataset / path).write_text("x")
    with pytest.raises(AdvpipeError, match=message):
        share(dataset, tmp_path / "out")


def test_outputs_that_would_overwrite_files_are_refused(dataset: Path, tmp_path: Path) -> None:
    """Before anything is read: it takes no time."""
    out = tmp_path / "tiny"
    share(dataset, out)
    (out / ".git").mkdir()
    (out / ".git" / "config").write_text("x")
    (dataset / "clean" / "metadata.yaml").write_bytes(b"#")
    with pytest.raises(AdvpipeError, match="tiny already exists"):
        share(dataset, out)
    with pytest.raises(AdvpipeError, match=r"also holds \.git/config, which `share` did not make"):
        share(dataset, out, ShareOptions(overwrite=True))
    for name, message in (("a.tar.gz", "a plain .tar"), ("a.zip", "a plain .tar"), ("a:b", "choose another")):
        with pytest.raises(AdvpipeError, match=message):
            share(dataset, tmp_path / name)


def test_a_report_on_other_bags_is_refused(dataset: Path, tmp_path: Path) -> None:
    path = dataset / "reports" / "small" / "report.json"
    report = json.loads(path.read_text())
    compared = report["provenance"]["compared"]
    digest = next(one["sha256"] for one in compared if one["bag"] == "fewer_points")
    text = path.read_text()
    path.write_text(text.replace(digest, "0" * 64))
    with pytest.raises(AdvpipeError, match="was made from a fewer_points that differs from the one in"):
        share(dataset, tmp_path / "out")
    path.write_text(text.replace('"fewer_points"', '"fewer"'))
    with pytest.raises(AdvpipeError, match="compares fewer, which is not in the data set"):
        share(dataset, tmp_path / "out")
    report["rows"] = 5
    path.write_text(json.dumps(report))
    with pytest.raises(AdvpipeError, match="is not a report of this version: rows"):
        share(dataset, tmp_path / "out")


def test_names_are_quoted_in_links_and_shell_commands(dataset: Path, tmp_path: Path) -> None:
    """A bag of another name than advpipe gives: spaces and umlauts."""
    (dataset / "fewer_points").rename(dataset / "größe (neu)")
    shutil.rmtree(dataset / "reports")
    share(dataset, tmp_path / "out")
    card = card_of(tmp_path / "out")
    assert "[`größe (neu)`](gr%C3%B6%C3%9Fe%20%28neu%29)" in card
    assert "](figures/gr%C3%B6%C3%9Fe%20%28neu%29.png)" in card
    assert (tmp_path / "out" / "figures" / "größe (neu).png").is_file()


def test_invalid_requests_are_refused(recorded: Path, dataset: Path, tmp_path: Path) -> None:
    for folder, message in (
        (recorded / "clean", "is not a data set: it holds no clean/metadata.yaml"),
        (tmp_path / "none", "does not exist"),
        (recorded / "scenario.yaml", "is not a folder"),
    ):
        with pytest.raises(AdvpipeError, match=message):
            share(folder, tmp_path / "out")
    for out in (recorded, recorded / "in", recorded.parent):
        with pytest.raises(AdvpipeError, match="choose another output"):
            share(recorded, out)
    with pytest.raises(AdvpipeError, match="only an archive can be split"):
        share(recorded, tmp_path / "out", ShareOptions(split_size_bytes=10**6))
    with pytest.raises(AdvpipeError, match="is not an SPDX identifier"):
        ShareOptions(licence="free for all!")
    (dataset / "link").symlink_to(recorded)
    with pytest.raises(AdvpipeError, match="is a link"):
        share(dataset, tmp_path / "out")
    (dataset / "link").unlink()
    (dataset / "reports" / "small" / "report.json").write_text("{")
    with pytest.raises(AdvpipeError, match=r"report\.json is not a report of this version: not valid JSON"):
        share(dataset, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_citation_is_a_text_or_a_file(tmp_path: Path) -> None:
    (tmp_path / "cite.bib").write_text("@misc{x}\n", encoding="utf-8")
    assert citation_text(str(tmp_path / "cite.bib")) == "@misc{x}"
    assert citation_text("A. Author\n2026") == "A. Author\n2026"
    assert citation_text("x" * 5000) == "x" * 5000
    assert citation_text(None) is None
