"""How a command fails: in one line."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import suggestion
from advpipe.pipeline.core.streams import flush_output
from advpipe.pipeline.process.failures import report_failure

ClickException: type[Exception] = next(
    kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException"
)
"""What the command line's own parser raises; older releases of typer have it in another package."""


class OneLineErrors(TyperGroup):
    """Whatever goes wrong becomes one line and an exit code; see `endings`.

    Help is plain text (`rich_markup_mode` of the app): to load `rich` takes longer than all else that
    `advpipe --help` does.
    """

    def get_params(self, ctx: Any) -> Any:
        """Its options. An absent flag of typer's own is False, not None: to validate that loads pydantic."""
        options = super().get_params(ctx)
        for option in options:
            if getattr(option, "is_flag", False) and option.default is None:
                option.default = False
        return options

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Writes each command's first sentence whole; click would cut it off at the end of the line."""
        helps = [(name, command.get_short_help_str(limit=1000)) for name, command in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl(helps)

    def make_context(self, *args: Any, **extra: Any) -> typer.Context:
        with _in_one_line():
            return super().make_context(*args, **extra)  # type: ignore[return-value]

    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        with _in_one_line():
            return super().invoke(ctx)

    def main(self, *args: Any, **options: Any) -> NoReturn:
        """Runs the command line, and ends the process."""
        try:
            code = super().main(*args, **{**options, "standalone_mode": False})
            flush_output()
        except ClickException as error:
            code = _misused(error)
        except SystemExit:
            raise
        except BaseException as error:
            code = report_failure(error)
        sys.exit(code if isinstance(code, int) else 0)


@contextmanager
def _in_one_line() -> Iterator[None]:
    """Ends the command with a one-line error for any exception inside, before typer prints it."""
    try:
        yield
    except (typer.Exit, SystemExit, ClickException):
        raise
    except BaseException as error:
        raise typer.Exit(report_failure(error)) from None


def _misused(error: Any) -> int:
    """Prints what is wrong with the options in one line, and where they are explained."""
    context = getattr(error, "ctx", None)
    if type(error).__name__ == "NoArgsIsHelpError":  # no mistake: whoever types `advpipe` alone wants help
        print(error.format_message(), file=sys.stderr)
        return 2
    where = getattr(error, "where", f"{context.command_path if context else 'advpipe'} --help")
    alike, text = getattr(error, "possibilities", None), error.format_message()
    if alike:  # as other errors say it; dashes make no two options alike
        given = error.option_name.lstrip("-")
        alike = [flag for flag in alike if suggestion(given, [flag.lstrip("-")])]
        text = f"{error.message}; {suggestion(error.option_name, alike)}".removesuffix("; ")
    return report_failure(UsageError(f"{text} (see {where})"))
