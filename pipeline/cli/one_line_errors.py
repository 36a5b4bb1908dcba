"""How a command fails: in one line."""

from __future__ import annotations

import os
import select
import sys
from typing import Any, TextIO

import typer
from typer.core import TyperGroup


class OneLineErrors(TyperGroup):
    """A user's mistake becomes one line and a non-zero exit code."""

    def make_context(self, *args: Any, **extra: Any) -> typer.Context:
        from advpipe.pipeline.missing_library import missing_library_line

        try:
            return super().make_context(*args, **extra)  # type: ignore[return-value]
        except ImportError as error:  # typer loads libraries of its own
            line = missing_library_line(error)
            if line is None:
                raise
            print(f"advpipe: {line}", file=sys.stderr)
            raise typer.Exit(1) from None

    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        from advpipe.pipeline.errors import AdvpipeError, one_line, os_error_line
        from advpipe.pipeline.missing_library import missing_library_line

        try:
            result = super().invoke(ctx)
            sys.stdout.flush()
            return result
        except AdvpipeError as error:
            print(f"advpipe: {one_line(error)}", file=sys.stderr)
            raise typer.Exit(error.exit_code) from None
        except (ImportError, OSError) as error:
            line = missing_library_line(error)
            if line is None and isinstance(error, ImportError):
                raise
            if line is None and isinstance(error, OSError):
                line = os_error_line(error)
            if not (isinstance(error, BrokenPipeError) and _is_unread(sys.stdout)):
                print(f"advpipe: {one_line(line)}", file=sys.stderr)
            raise typer.Exit(1) from None
        except KeyboardInterrupt:
            print("advpipe: interrupted", file=sys.stderr)
            raise typer.Exit(130) from None


def _is_unread(stream: TextIO) -> bool:
    """Whether the reader is gone, as after `| head`; what is still to be written then goes nowhere."""
    poll = select.poll()
    poll.register(stream, 0)  # errors alone are reported
    if not poll.poll(0):
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return True
