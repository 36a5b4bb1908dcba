"""Options that several commands share, and the way in which all of them answer."""

from __future__ import annotations

import inspect
import os
import shlex
import shutil
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from advpipe.pipeline.campaigns.sweep.options import SweepOptions
from advpipe.pipeline.cli.completion import detector_names, device_names
from advpipe.pipeline.core.options import parser_options
from advpipe.stages.evaluate.options import Options

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an output that exists.")]


def cli_option(model: type, name: str, *flags: str, **shown: Any) -> Any:
    """The option of the command line that a field of a model of options is, with its help and bounds."""
    return typer.Option(*flags, **parser_options(model, name), **shown)  # type: ignore[misc]


def flag_of(name: str) -> str:
    """The option of the command line that sets a parameter of this name.

    >>> flag_of("eps_cm")
    '--eps-cm'
    """
    return "--" + name.replace("_", "-")


LidarTopic = Annotated[str | None, cli_option(Options, "lidar_topic", "--lidar")]
Workers = Annotated[int | None, cli_option(SweepOptions, "workers", "--workers", show_default="one a core")]


def _without_job_server(context: typer.Context, address: str | None) -> str | None:
    """RAY_ADDRESS may also name the server that jobs are submitted to: it is no cluster's address."""
    source = context.get_parameter_source("cluster")
    is_from_environment = source is not None and source.name == "ENVIRONMENT"
    return None if address and is_from_environment and address.startswith("http") else address


Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        envvar="RAY_ADDRESS",
        callback=_without_job_server,
        help="Work on a Ray cluster: host:port, or auto for the one on this machine.",
        show_default=False,
    ),
]
"""The cluster that does the work, see `use_cluster`."""
BaselineTries = Annotated[
    int | None,
    cli_option(
        Options, "baseline_tries", "--baseline-tries", show_default="as many as the attack has queries"
    ),
]
LidarHeight = Annotated[float | None, cli_option(Options, "lidar_height_m", "--lidar-height")]
Level = Annotated[bool, cli_option(Options, "level", "--level")]
ScaleIntensity = Annotated[float, cli_option(Options, "scale_intensity", "--scale-intensity")]
Device = Annotated[str, cli_option(Options, "device", "--device", autocompletion=device_names)]
DetectorName = Annotated[
    str, cli_option(SweepOptions, "detector", "--detector", autocompletion=detector_names)
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Also print versions, what is loaded, seeds and times.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as one JSON document, for programs.")]


@dataclass(frozen=True)
class Answer:
    """What a command found or made.

    document: for programs, with the paths of outputs and all figures; see `strict_json`. show: prints it for
    people. exit_code: 1 where a check found faults. made: what it made and where it is, such as
    `{"report": page}`. next_commands: what people may type next, see `typed`.
    """

    document: Mapping[str, Any]
    show: Callable[[], None]
    exit_code: int = 0
    made: Mapping[str, Path] = field(default_factory=dict)
    next_commands: Sequence[str] = ()


def answering(command: Callable[..., Answer]) -> Callable[..., None]:
    """The command as typer runs it: with --quiet, --verbose and --json, and its answer printed.

    Arguments that it takes by any name are no options until `AttackCommand` makes them some.
    """

    @wraps(command)
    def answer(*args: Any, quiet: bool, verbose: bool, as_json: bool, **options: Any) -> None:
        from advpipe.pipeline.core.option_names import use_flags
        from advpipe.pipeline.core.streams import safe_streams
        from advpipe.pipeline.core.verbosity import Verbosity, phase, use_verbosity
        from advpipe.pipeline.process.folder import usable

        with use_flags(), safe_streams(), use_verbosity(Verbosity(quiet, verbose, as_json)):
            args, options = usable([*args]), {name: usable(value) for name, value in options.items()}
            if verbose:
                _print_versions()
            with phase("in all"):
                given = command(*args, **options)
            if as_json:
                from advpipe.pipeline.process.document import strict_json

                print(strict_json(given.document))
            elif not quiet:
                given.show()
                print_ending(given.made, given.next_commands)
            sys.stdout.flush()
        if given.exit_code:
            raise typer.Exit(given.exit_code)

    hints = get_type_hints(command, include_extras=True)
    parameters = [
        one.replace(annotation=hints[one.name])
        for one in inspect.signature(command).parameters.values()
        if one.kind is not one.VAR_KEYWORD
    ]
    for name, kind in (("quiet", Quiet), ("verbose", Verbose), ("as_json", AsJson)):
        one = inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
        parameters.append(one)
    answer.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    answer.__annotations__ = {one.name: one.annotation for one in parameters}
    return answer


def show_part(answer: Answer) -> dict[str, Any]:
    """Shows an answer that is a part of another one, as soon as it is known; returns its document."""
    from advpipe.pipeline.core.status_line import above_status
    from advpipe.pipeline.core.verbosity import is_for_people

    if is_for_people():
        with above_status():
            answer.show()
            print_ending(answer.made)
            sys.stdout.flush()
    return dict(answer.document)


def print_ending(made: Mapping[str, Path], next_commands: Sequence[str] = ()) -> None:
    """Prints where the result is, and what to type next."""
    lines = [*made.items(), *(("" if number else "next", line) for number, line in enumerate(next_commands))]
    labels = [f"{label}:" if label else "" for label, _ in lines]
    width = max(map(len, labels), default=0)
    for label, (_, text) in zip(labels, lines, strict=True):
        print(f"{label:<{width}} {text}")


def typed(*words: object) -> str:
    """A command of advpipe that can be pasted into a shell, such as `typed("evaluate", folder)`."""
    return " ".join([_program(), *(shlex.quote(_argument(word)) for word in words)])


def _argument(word: object) -> str:
    """A path that begins with a dash would be read as an option."""
    text = str(word)
    return f"./{text}" if isinstance(word, Path) and text.startswith("-") else text


def _program() -> str:
    """`advpipe` where the shell finds the one that runs; otherwise as it was typed, as in a virtual
    environment that is not active."""
    this = Path(sys.argv[0])
    if this.stem != "advpipe":
        return "advpipe"
    found = shutil.which("advpipe")
    if found is None or not this.exists() or not os.path.samefile(found, this):
        return shlex.quote(str(this))
    return "advpipe"


def print_line(text: object) -> Callable[[], None]:
    """Prints the text: what an answer of one line shows; on a terminal, broken between its words."""
    return lambda: print(_between_words(str(text)) if sys.stdout.isatty() else text)


def _between_words(text: str) -> str:
    columns = shutil.get_terminal_size((80, 24)).columns
    return "\n".join(
        textwrap.fill(line, columns, break_long_words=False, break_on_hyphens=False)
        for line in text.splitlines()
    )


def _print_versions() -> None:
    """Prints the versions that a figure may depend on."""
    import platform

    from advpipe.pipeline.core.verbosity import detail
    from advpipe.pipeline.core.versions import installed

    packages = ("advpipe", "numpy", "open3d-cpu", "open3d", "libsumo", "torch")
    found = {package: installed(package) for package in packages}
    versions = ", ".join(f"{package} {number}" for package, number in found.items() if number)
    detail(f"{versions}; Python {platform.python_version()} on {platform.platform()}")
