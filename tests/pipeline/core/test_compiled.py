"""C sources become libraries where a compiler is there, once; without one, the caller is told."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys

import pytest

from advpipe.pipeline.core import compiled
from advpipe.pipeline.core.compiled import OFF, c_compiler, compiled_library, compiler_version

needs_compiler = pytest.mark.skipif(not c_compiler(), reason="needs a C compiler")


@pytest.fixture
def source(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)
    compiled_library.cache_clear()
    compiler_version.cache_clear()
    source = tmp_path / "twice.c"
    source.write_text("int twice(int x) { return 2 * x; }\n")
    yield source
    compiled_library.cache_clear()
    compiler_version.cache_clear()


def compile_in_another_process(source):
    """This one would load what it had loaded before from the same path."""
    code = "import sys; from pathlib import Path; from advpipe.pipeline.core.compiled import compiled_library"
    call = "assert compiled_library(Path(sys.argv[1])) is not None"
    subprocess.run([sys.executable, "-c", f"{code}; {call}", str(source)], check=True)


@needs_compiler
def test_a_source_is_compiled_once(source, tmp_path, monkeypatch):
    library = compiled_library(source)
    assert isinstance(library, ctypes.CDLL)
    assert library.twice(21) == 42
    folder = tmp_path / "cache" / "advpipe"
    assert [path.suffix for path in folder.iterdir()] == [".so"]
    monkeypatch.setattr(compiled, "_compile", pytest.fail)
    compiled_library.cache_clear()
    assert compiled_library(source).twice(4) == 8  # from the cache


@needs_compiler
def test_another_source_is_another_library(source):
    assert compiled_library(source).twice(1) == 2
    source.write_text("int twice(int x) { return x + x + 1; }\n")
    compiled_library.cache_clear()
    assert compiled_library(source).twice(1) == 3


@needs_compiler
def test_a_source_that_does_not_compile_gives_none(source, tmp_path):
    source.write_text("int twice(\n")
    assert compiled_library(source) is None
    assert list((tmp_path / "cache" / "advpipe").iterdir()) == []


def test_without_a_compiler_there_is_no_library(source, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert c_compiler() == []
    assert compiled_library(source) is None


@needs_compiler
def test_the_environment_can_forbid_compiling(source, monkeypatch):
    monkeypatch.setenv(OFF, "1")
    assert c_compiler() == []
    assert compiled_library(source) is None


@needs_compiler
def test_the_compiler_is_the_one_that_cc_names(source, tmp_path, monkeypatch):
    broken = tmp_path / "broken-cc"
    broken.write_text("#!/bin/sh\nexit 1\n")
    broken.chmod(0o700)
    monkeypatch.setenv("CC", str(broken))
    assert c_compiler() == [str(broken)]
    assert compiled_library(source) is None
    monkeypatch.setenv("CC", shutil.which("cc") or shutil.which("gcc") or shutil.which("clang"))
    compiled_library.cache_clear()
    assert compiled_library(source).twice(3) == 6


@needs_compiler
def test_nothing_is_loaded_from_a_folder_that_others_may_write_to(source, tmp_path):
    assert compiled_library(source) is not None
    (tmp_path / "cache" / "advpipe").chmod(0o777)
    compiled_library.cache_clear()
    assert compiled_library(source) is None


@needs_compiler
@pytest.mark.parametrize(
    "damage", [lambda data: data[: len(data) // 2], lambda data: data + b"x", lambda _: b""]
)
def test_a_damaged_library_is_made_again(source, tmp_path, damage):
    compile_in_another_process(source)
    (made,) = (tmp_path / "cache" / "advpipe").iterdir()
    intact = made.read_bytes()
    made.write_bytes(damage(intact))
    assert compiled_library(source).twice(5) == 10
    assert made.read_bytes() == intact


@needs_compiler
def test_a_link_is_not_loaded(source, tmp_path):
    compile_in_another_process(source)
    (made,) = (tmp_path / "cache" / "advpipe").iterdir()
    made.rename(tmp_path / "elsewhere.so")
    made.symlink_to(tmp_path / "elsewhere.so")
    assert compiled_library(source).twice(5) == 10
    assert not made.is_symlink()


@needs_compiler
def test_a_library_that_does_not_load_gives_none(source, monkeypatch):
    def cut_off(*arguments):
        path = arguments[2] / "cut-off.so"
        path.write_bytes(b"no library")
        return path

    monkeypatch.setattr(compiled, "_compile", cut_off)
    assert compiled_library(source) is None


@needs_compiler
def test_the_compiler_may_have_arguments(source, tmp_path, monkeypatch):
    log = tmp_path / "log"
    wrapper = tmp_path / "wrapper"
    wrapper.write_text(f'#!/bin/sh\necho "$1" >> {log}\nexec "$@"\n')
    wrapper.chmod(0o700)
    monkeypatch.setenv("CC", f"{wrapper} {c_compiler()[0]}")
    assert compiled_library(source).twice(6) == 12
    assert log.read_text().count("cc") + log.read_text().count("clang") == 2  # its version, and the source


@needs_compiler
def test_a_place_relative_to_the_current_folder_is_ignored(source, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    assert compiled_library(source).twice(7) == 14
    assert not (tmp_path / "cache").exists()
    assert (tmp_path / "home" / ".cache" / "advpipe").is_dir()


def test_a_source_that_is_missing_gives_none(source, tmp_path):
    assert compiled_library(tmp_path / "none.c") is None


@needs_compiler
def test_without_a_place_for_it_there_is_no_library(source, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert compiled_library(source) is None
