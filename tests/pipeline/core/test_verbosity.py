"""How much is printed, and where; warnings of libraries are not printed."""

from __future__ import annotations

import warnings

import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.verbosity import Verbosity, detail, notice, phase, print_result, use_verbosity


def printed(capsys: pytest.CaptureFixture[str], **how: bool) -> tuple[str, str]:
    with use_verbosity(Verbosity(**how)):
        print_result("cell")
        notice("note\x1b")
        with phase("work"):
            detail("seed 7")
            warnings.warn("overflow encountered", RuntimeWarning, stacklevel=1)
    captured = capsys.readouterr()
    return captured.out, captured.err


def test_by_default_results_and_notices_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys) == ("cell\n", "note\\x1b\n")


def test_quiet_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, quiet=True) == ("", "")


def test_with_json_standard_output_holds_only_the_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, as_json=True) == ("", "cell\nnote\\x1b\n")


def test_verbose_prints_details_times_and_warnings(capsys: pytest.CaptureFixture[str]) -> None:
    out, errors = printed(capsys, verbose=True)
    assert out == "cell\n"
    assert "s] seed 7\n" in errors
    assert "s] RuntimeWarning: overflow encountered (" in errors
    assert "s] work: 0." in errors


def test_the_former_verbosity_is_restored(capsys: pytest.CaptureFixture[str]) -> None:
    shown = warnings.showwarning
    printed(capsys, verbose=True)
    assert warnings.showwarning is shown
    detail("not shown")
    assert capsys.readouterr() == ("", "")


def test_quiet_and_verbose_together_are_refused() -> None:
    with pytest.raises(UsageError, match="contradict"):
        Verbosity(quiet=True, verbose=True)
