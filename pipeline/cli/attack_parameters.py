"""The options of `advpipe attack` that are parameters of the attack named by `--type`.

Their names, types, defaults and texts are those of the attack's class. It is imported, with torch for LiDAR
attacks, only for an option that the command itself does not have, and for the help on one attack.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from typer.core import TyperCommand

from advpipe.pipeline.cli.attack import attack_command, read_value
from advpipe.pipeline.cli.completion import words_of
from advpipe.pipeline.cli.shared import Answer, answering, flag_of
from advpipe.pipeline.core.attack_options import AttackOptions
from advpipe.pipeline.core.progress import open_progress
from advpipe.pipeline.core.verbosity import Verbosity, use_verbosity

if TYPE_CHECKING:
    from advpipe.stages.attack.parameter_docs import Parameter

_HELP = ("--help", "-h")
_QUIET = ("--quiet", "-q")


class AttackCommand(TyperCommand):
    """`advpipe attack`; where its arguments name parameters of an attack, a command that has them runs."""

    def make_context(self, info_name: Any, args: list[str], *others: Any, **extra: Any) -> Any:
        own = {flag for one in self.params for flag in (*one.opts, *one.secondary_opts)}
        if extra.get("resilient_parsing"):  # a shell completes
            completed = _command_with(_completed_parameters(_attack_named(args), own))
            return completed.make_context(info_name, args, *others, **extra)
        flags = {argument.partition("=")[0] for argument in args if argument.startswith("-")}
        attack = _attack_named(args)
        wants_help = attack is not None and not flags.isdisjoint(_HELP)
        if not wants_help and all(flag in {*own, *_HELP} or flag[:2] != "--" for flag in flags):
            return super().make_context(info_name, args, *others, **extra)
        attack = attack or AttackOptions.type
        is_quiet = wants_help or not flags.isdisjoint(_QUIET)
        with use_verbosity(Verbosity(quiet=is_quiet)), open_progress(f"reading about {attack}"):
            command, parameters = _command_of(attack, own)
        try:
            return command.make_context(info_name, args, *others, **extra)
        except Exception as error:
            if hasattr(error, "possibilities") and hasattr(error, "message"):  # no such option
                if parameters:
                    vars(error)["where"] = f"advpipe attacks {attack}"
                else:
                    error.message += f"; {attack} has no parameters"
            raise


class _WithParameters(TyperCommand):
    """Its help has the attack's parameters in a section of their own."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        every = self.params
        parameters = [one for one in every if getattr(one, "rich_help_panel", None)]
        self.params = [one for one in every if one not in parameters]
        super().format_options(ctx, formatter)
        self.params = every
        if parameters:
            with formatter.section(parameters[0].rich_help_panel):  # type: ignore[attr-defined]
                formatter.write_dl([one.get_help_record(ctx) for one in parameters])


def _attack_named(args: list[str]) -> str | None:
    """The last value of `--type`, the one that counts."""
    for place in reversed(range(len(args))):
        flag, equals, value = args[place].partition("=")
        if flag == "--type" and (equals or place + 1 < len(args)):
            return value if equals else args[place + 1]
    return None


def _command_of(attack: str, taken: set[str]) -> tuple[Any, list[str]]:
    """`advpipe attack` with the attack's parameters as options but for those whose flag is taken; and their
    flags. Raises AdvpipeError for an attack that is unknown."""
    from advpipe.pipeline.scenario.attacks import attack_spec
    from advpipe.stages.attack.parameter_docs import documented_parameters, summary
    from advpipe.stages.attack.registry import default_budget, find_attack, resolved_name

    attack_class = find_attack(resolved_name(attack_spec({"type": attack})).type)
    usual, panel = default_budget(attack), f"Parameters of {attack}"
    parameters = [
        _as_argument(one, usual.get(one.name, one.default), panel)
        for one in documented_parameters(attack_class)
        if flag_of(one.name) not in taken
    ]
    about = f"{attack}: {summary(attack_class)}"
    return _command_with(parameters, about), [flag_of(one.name) for one in parameters]


def _command_with(parameters: Sequence[inspect.Parameter], about: str = "") -> Any:
    """`advpipe attack` with more options; about: the end of its help."""
    general = inspect.signature(attack_command).parameters.values()
    signature = [*(one for one in general if one.kind is not one.VAR_KEYWORD), *parameters]

    def command(**options: Any) -> Answer:
        return attack_command(**options)

    command.__doc__ = f"{inspect.getdoc(attack_command)}\n\n{about}"
    command.__annotations__ = {
        **get_type_hints(attack_command, include_extras=True),
        **{one.name: one.annotation for one in parameters},
    }
    command.__signature__ = inspect.Signature(signature)  # type: ignore[attr-defined]
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(cls=_WithParameters)(answering(command))
    return typer.main.get_command(app)


def _completed_parameters(attack: str | None, taken: set[str]) -> list[inspect.Parameter]:
    """What a shell completes of an attack: its parameters, without loading its class."""
    from advpipe.stages.attack.parameter_source import SWITCH, parameter_words

    found = []
    for name, words in parameter_words(attack or AttackOptions.type).items():
        flag = flag_of(name)
        if flag in taken:
            continue
        option: Any = Annotated[str | None, typer.Option(flag, autocompletion=words_of(words))]
        if words == SWITCH:
            option = Annotated[bool | None, typer.Option(f"{flag}/--no-{flag[2:]}")]
        one = inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=option)
        found.append(one)
    return found


def _as_argument(one: Parameter, default: Any, panel: str) -> inspect.Parameter:
    """The argument of which typer makes the parameter's option; None stands for not given."""
    from advpipe.pipeline.core.short_repr import short_repr
    from advpipe.stages.attack.parameters import is_share

    flag, types = flag_of(one.name), set(one.types)
    usual = "" if default in (inspect.Parameter.empty, None, (), "") else f" [default: {default}]"
    shown: dict[str, Any] = {"help": one.help + usual, "rich_help_panel": panel}
    plain_type = next((each for each in (str, float, int) if each in types), None)
    if types == {bool}:
        option: Any = Annotated[bool | None, typer.Option(f"{flag}/--no-{flag[2:]}", **shown)]
    elif plain_type is float and is_share(one.name):
        option = Annotated[Any, typer.Option(flag, parser=_read_share, metavar="SHARE", **shown)]
    elif plain_type is not None and not isinstance(default, tuple):
        option = Annotated[plain_type | None, typer.Option(flag, **shown)]
    else:

        def read(text: str) -> Any:
            return read_value(text, f"{flag} {short_repr(text)}")

        option = Annotated[Any, typer.Option(flag, parser=read, metavar="YAML", **shown)]
    return inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=option)


def _read_share(text: str) -> float:
    """0.01 of `0.01` and of `1%`; the parser of options calls it with each word."""
    from advpipe.pipeline.core.section import parse_share
    from advpipe.pipeline.core.short_repr import short_repr

    try:
        return float(parse_share(text))
    except ValueError:
        raise typer.BadParameter(f"{short_repr(text)} is not a share; write 0.01 or 1%") from None
