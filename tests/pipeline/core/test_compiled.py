"""C sources become libraries where a compiler is there, once; without one, the caller is told."""

from __future__ import annotations

import ctypes
import shutil

import pytest

from advpipe.pipeline.core import compiled
from advpipe.pipeline.core.compiled import OFF, c_compiler, compiled_library

needs_compiler = pytest.mark.skipif(c_compiler() is None, reason="needs a C compiler")


@pytest.fixture
def source(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)
    compiled_library.cache_clear()
    source = tmp_path / "twice.c"
    source.write_text("int twice(int x) { return 2 * x; }\n")
    yield source
    compiled_library.cache_clear()


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
    assert c_compiler() is None
    assert compiled_library(source) is None


@needs_compiler
def test_the_environment_can_forbid_compiling(source, monkeypatch):
    monkeypatch.setenv(OFF, "1")
    assert c_compiler() is None
    assert compiled_library(source) is None


@needs_compiler
def test_the_compiler_is_the_one_that_cc_names(source, tmp_path, monkeypatch):
    broken = tmp_path / "broken-cc"
    broken.write_text("#!/bin/sh\nexit 1\n")
    broken.chmod(0o700)
    monkeypatch.setenv("CC", str(broken))
    assert c_compiler() == str(broken)
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
def test_a_library_that_does_not_load_gives_none(source, monkeypatch):
    monkeypatch.setattr(compiled, "_compile", lambda *paths: paths[-1].write_bytes(b"no library"))
    assert compiled_library(source) is None


@needs_compiler
def test_without_a_place_for_it_there_is_no_library(source, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert compiled_library(source) is None
