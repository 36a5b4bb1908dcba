"""The command that lists the attacks, or explains one."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterable
from itertools import groupby
from typing import TYPE_CHECKING, Annotated

import typer

from advpipe.pipeline.cli.completion import attack_names
from advpipe.pipeline.cli.shared import Answer, flag_of
from advpipe.pipeline.core.progress import with_progress

if TYPE_CHECKING:
    from advpipe.stages.attack.catalogue import CatalogueEntry
    from advpipe.stages.attack.parameter_docs import Parameter

_NAME_COLUMNS = 29
"""Of the list: two more than the longest name and its indentation."""

_WIDEST = 100
"""Lines of text beyond this many columns are hard to read, however wide the terminal is."""


@with_progress("listing the attacks")
def attacks_command(
    attack: Annotated[
        str | None,
        typer.Argument(
            help="An attack to explain, or module:Class; or a family to list.",
            show_default="all",
            autocompletion=attack_names,
        ),
    ] = None,
) -> Answer:
    """List the attacks by family, or explain one: its parameters, bounds and what it makes untrue."""
    from advpipe.stages.attack.catalogue import FAMILIES, catalogue, catalogue_entry

    family = next((one for one in FAMILIES if attack and attack.lower() == one), None)
    if attack is not None and family is None:
        entry = catalogue_entry(attack)
        return Answer({"attacks": [entry.plain()]}, lambda: _explain(entry))
    entries = catalogue(family)
    return Answer({"attacks": [one.plain() for one in entries]}, lambda: _list(entries))


def _list(entries: Iterable[CatalogueEntry]) -> None:
    for title, family in groupby(entries, key=lambda entry: entry.family_title):
        print(title)
        for entry in family:
            _print_row(entry.name, entry.headline)
            if entry.budget:
                _print_row("", _budget(entry))
            elif entry.bounds:
                _print_row("", f"Bounds: {', '.join(f'{one.quantity} {one}' for one in entry.bounds)}.")
        print()
    print("Parameters and bounds of one: advpipe attacks NAME")
    print("Carry one out:                advpipe attack --type NAME")


def _budget(entry: CatalogueEntry) -> str:
    default = "" if entry.budget_default is None else f" (default {entry.budget_default:g})"
    paper = " to ".join(f"{value:g}" for value in entry.budget_published)
    published = f"; the paper: {paper}" if paper else ""
    return f"Budget: {flag_of(entry.budget)}{default}{published}. {entry.budget_title}."


def _explain(entry: CatalogueEntry) -> None:
    names = ", ".join((entry.name, *entry.also_known_as))
    _print_text(f"{names} ({entry.family})")
    _print_text(entry.summary)
    if entry.budget:
        _print_text(_budget(entry))
    if entry.recipe:
        print("\nRecipes")
        _print_text(entry.recipe, "  ")
    print("\nParameters" if entry.parameters else "\nNo parameters.")
    for one in entry.parameters:
        _print_text(_signature(one), "  ")
        if one.help:
            _print_text(one.help, "      ")
    if entry.bounds:
        print("\nBounds with these parameters; `advpipe verify` measures them")
        for bound in entry.bounds:
            _print_text(f"{bound.quantity}: {bound} ({bound.meaning})", "  ")
    if entry.untrue:
        print("\nWhat its messages claim falsely, at most")
        _print_text(", ".join(entry.untrue), "  ")
    given = "".join(f" {flag_of(one.name)} ..." for one in entry.parameters if _is_required(one))
    print(f"\nCarry it out: advpipe attack --type {entry.name}{given} {entry.usual_options}".rstrip())


def _signature(one: Parameter) -> str:
    """`--ratio FLOAT (default 0.01)`."""
    types = " or ".join(dict.fromkeys(each.__name__ for each in one.types)).upper()
    if _is_required(one):
        default = "required"
    else:
        default = "not set by default" if one.default in (None, (), "") else f"default {one.default}"
    return f"{flag_of(one.name)} {types} ({default})".replace("  ", " ")


def _is_required(one: Parameter) -> bool:
    from advpipe.stages.attack.parameters import REQUIRED

    return one.default is REQUIRED


def _print_row(name: str, text: str) -> None:
    head = f"  {name}".ljust(_NAME_COLUMNS)
    print(textwrap.fill(text, _columns(), initial_indent=head, subsequent_indent=" " * _NAME_COLUMNS))


def _print_text(text: str, indent: str = "") -> None:
    print(textwrap.fill(text, _columns(), initial_indent=indent, subsequent_indent=indent))


def _columns() -> int:
    return min(shutil.get_terminal_size((80, 24)).columns, _WIDEST)
