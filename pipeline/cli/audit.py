"""The command that tells whether a data set gives its attacks away."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from advpipe.pipeline.cli.shared import Answer
from advpipe.pipeline.core.progress import with_progress

if TYPE_CHECKING:
    from advpipe.pipeline.audit.result import Audit


@with_progress("auditing {datasets}")
def audit_command(
    datasets: Annotated[list[Path], typer.Argument(help="Data set folders, each a drive with attacks.")],
    train: Annotated[
        list[Path] | None,
        typer.Option("--train", help="Data set of another drive to learn from; repeat it for more."),
    ] = None,
    clouds: Annotated[
        int, typer.Option("--clouds", help="LiDAR clouds of a bag to measure, at most.", min=1)
    ] = 40,
) -> Answer:
    """Say whether anything but the attack itself tells attacked from clean: order, sizes, times, ids.

    Exit code 1 if a probe does and the attack's definition does not imply it.
    """
    from advpipe.pipeline.audit.run import audit
    from advpipe.pipeline.core.progress import plan_progress

    plan_progress({f"measuring {path}": 1 for path in (*datasets, *(train or ()))})
    result = audit(datasets, train or (), most_clouds=clouds)
    return Answer(json.loads(result.to_json()), lambda: _show(result), exit_code=0 if result.is_good else 1)


def _show(result: Audit) -> None:
    for finding in result.findings:
        print(finding)
    for excused in result.implied:
        print(f"not a finding: {excused}")
    for attack in dict.fromkeys(each.attack for each in result.results):
        strongest = result.strongest(attack)
        if strongest is not None and not strongest.is_finding:
            print(f"strongest: {strongest}")
    for attack, why in result.unchecked.items():
        print(f"not judged: {attack}: {why}")
    if not all(each.is_trained for each in result.results):
        print("without another drive to learn from, both directions of a probe were tried")
    print(result)
