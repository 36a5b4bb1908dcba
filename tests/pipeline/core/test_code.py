"""The checksum of the code: it equals one computed by hand, and covers all code that results depend on."""

import ast
import hashlib
import shutil
import subprocess

import pytest

from advpipe.pipeline.core import code
from advpipe.pipeline.core.code import CLOUDS, PACKAGE, code_sha256, source_commit
from advpipe.stages.attack.provenance import LIDAR, MESSAGES
from advpipe.stages.evaluate.provenance import REPORTING, SCORING

NO_FIGURE = {
    "pipeline/misbehaviour/detectors.py",
    "pipeline/misbehaviour/verdicts.py",
    "pipeline/bag/lidar_mount.py",
    "pipeline/detector/input_notice.py",
    "pipeline/bag/__init__.py",
    "pipeline/bag/carried.py",
    "pipeline/bag/part.py",
    "pipeline/bag/provenance.py",
    "pipeline/bag/provenance_record.py",
    "pipeline/bag/reader.py",
    "pipeline/bag/writer.py",
    "pipeline/birds_eye.py",
    "pipeline/core/__init__.py",
    "pipeline/core/attack_options.py",
    "pipeline/core/bounded_parquet.py",
    "pipeline/core/code.py",
    "pipeline/core/document.py",
    "pipeline/core/errors.py",
    "pipeline/core/figure.py",
    "pipeline/core/gc_freeze.py",
    "pipeline/core/hashing.py",
    "pipeline/core/html_page.py",
    "pipeline/core/option_names.py",
    "pipeline/core/implementation.py",
    "pipeline/core/job_engine.py",
    "pipeline/core/job_errors.py",
    "pipeline/core/jobs.py",
    "pipeline/core/local_processes.py",
    "pipeline/core/leftover_names.py",
    "pipeline/core/lock.py",
    "pipeline/core/missing_library.py",
    "pipeline/core/lidar_height.py",
    "pipeline/core/nearest.py",
    "pipeline/core/options.py",
    "pipeline/core/partial.py",
    "pipeline/core/picture_file.py",
    "pipeline/core/plain_json.py",
    "pipeline/core/plain_yaml.py",
    "pipeline/core/plugins.py",
    "pipeline/core/progress.py",
    "pipeline/core/remote_path.py",
    "pipeline/core/shipped_scenarios.py",
    "pipeline/core/short_repr.py",
    "pipeline/core/signals.py",
    "pipeline/core/streams.py",
    "pipeline/core/tabular.py",
    "pipeline/core/text.py",
    "pipeline/core/verbosity.py",
    "pipeline/core/versions.py",
    "pipeline/core/atomic_file.py",
    "pipeline/mcap/__init__.py",
    "pipeline/mcap/background.py",
    "pipeline/mcap/channel.py",
    "pipeline/mcap/checksums.py",
    "pipeline/mcap/file_sequence.py",
    "pipeline/mcap/qos.py",
    "pipeline/mcap/reader.py",
    "pipeline/mcap/records.py",
    "pipeline/mcap/salvage.py",
    "pipeline/mcap/summary.py",
    "pipeline/mcap/unpacking.py",
    "pipeline/mcap/writer.py",
    "pipeline/messages/build.py",
    "pipeline/messages/topics.py",
    "pipeline/messages/types.py",
    "pipeline/process/__init__.py",
    "pipeline/viewer/__init__.py",
    "pipeline/viewer/encoding.py",
    "pipeline/viewer/map_lines.py",
    "pipeline/viewer/page.py",
    "pipeline/viewer/points.py",
    "pipeline/viewer/poses.py",
    "pipeline/viewer/scene.py",
    "pipeline/core/section.py",
    "pipeline/core/bounds.py",
    "pipeline/labels/__init__.py",
    "pipeline/labels/declaration.py",
    "stages/attack/base.py",
    "stages/attack/family_registry.py",
    "stages/attack/job.py",
    "pipeline/core/job_folder.py",
    "stages/attack/parameter_docs.py",
    "stages/attack/plugin.py",
    "stages/attack/parameters.py",
    "pipeline/viewer_layouts/files.py",
}
"""What clouds and messages come through, but which decides nothing about them: other code of it reads the
same figures."""

OF_CLOUDS = {
    source.relative_to(PACKAGE).as_posix() for part in CLOUDS for source in code._sources(PACKAGE / part)
}
SCENARIO = {
    *(f"pipeline/scenario/{name}.py" for name in ("map", "sensors", "simulation")),
    *(f"pipeline/sensors/{name}.py" for name in ("registry", "sensor", "weather")),
    "pipeline/sensors/lidar/lidars.py",
    "pipeline/sensors/lidar/section.py",
    "pipeline/sensors/lidar/presets.py",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    monkeypatch.setattr(code, "PACKAGE", tmp_path)
    (tmp_path / "b" / "deep").mkdir(parents=True)
    (tmp_path / "a.py").write_text("x = 1\n")
    (tmp_path / "b" / "deep" / "c.py").write_text("y\n")
    (tmp_path / "b" / "d.c").write_text("z;\n")
    (tmp_path / "b" / "notes.md").write_text("no code")
    code_sha256.cache_clear()
    source_commit.cache_clear()
    yield tmp_path
    code_sha256.cache_clear()
    source_commit.cache_clear()


def test_the_hash_equals_one_computed_by_hand(package):
    wanted = hashlib.sha256(b"a.py\x006\x00x = 1\nb/d.c\x003\x00z;\nb/deep/c.py\x002\x00y\n").hexdigest()
    assert (
        code_sha256("a.py", "b") == code_sha256("b", "a.py") == code_sha256("a.py", "b", "b/deep") == wanted
    )
    (package / "a.py").write_bytes(b"x = 1\r\n")
    code_sha256.cache_clear()
    assert code_sha256("a.py", "b") == wanted  # a checkout with other line ends


@pytest.mark.parametrize(
    "change", [("a.py", "x = 2\n"), ("b/new.py", ""), ("b/deep/c.py", "z\n"), ("b/d.c", "")]
)
def test_any_change_of_path_or_text_changes_the_hash(package, change):
    before = code_sha256("a.py", "b")
    (package / change[0]).write_text(change[1])
    assert code_sha256("a.py", "b") == before  # the code that was loaded
    code_sha256.cache_clear()
    assert code_sha256("a.py", "b") != before


def test_the_commit_is_marked_if_code_differs(package):
    def git(*arguments):
        person = ("-c", "user.name=A", "-c", "user.email=a@example.org")
        subprocess.run(["git", "-C", str(package), *person, *arguments], check=True, capture_output=True)

    def now():
        source_commit.cache_clear()
        return source_commit()

    assert now() is None
    git("init")
    assert now() is None
    git("add", ".")
    git("commit", "-m", "first")
    first = now()
    assert first == (package / ".git/refs/heads").joinpath(_branch(package)).read_text().strip()
    (package / "a.py").write_text("x = 3\n")
    assert now() == f"{first}+"


def _branch(package):
    return (package / ".git/HEAD").read_text().strip().removeprefix("ref: refs/heads/")


def test_a_missing_part_raises_an_error(package):
    shutil.rmtree(package / "b")
    with pytest.raises(FileNotFoundError):
        code_sha256("a.py", "b")


@pytest.mark.parametrize(
    ("parts", "others"),
    [(LIDAR, set()), (SCORING, set()), (MESSAGES, OF_CLOUDS | SCENARIO), (REPORTING, SCENARIO)],
    ids=["clouds", "scores", "messages", "reports"],
)
def test_the_parts_contain_all_that_their_code_imports(parts, others):
    """Every module of ours that these import, but for those that decide no figure: a bag's scenario spells
    out every default, and code of attacks on clouds decides nothing about messages."""
    sources = {source for part in parts for source in code._sources(PACKAGE / part)}
    python = {source for source in sources if source.suffix == ".py"}
    wanted = {imported for source in python for imported in _imports(source)}
    missing = {path.relative_to(PACKAGE).as_posix() for path in wanted - sources}
    assert missing <= NO_FIGURE | others


def test_every_listed_part_exists():
    assert len({code_sha256(*parts) for parts in (CLOUDS, LIDAR, SCORING, MESSAGES, REPORTING)}) == 5


def _imports(source):
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("advpipe."):
            module = PACKAGE.joinpath(*node.module.split(".")[1:])
            for name in node.names:
                if (module / f"{name.name}.py").is_file():
                    yield module / f"{name.name}.py"
                elif module.with_suffix(".py").is_file():
                    yield module.with_suffix(".py")
                else:
                    yield module / "__init__.py"
