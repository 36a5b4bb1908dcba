"""The command that tries what advpipe relies on in another simulator."""

from __future__ import annotations

from typing import Annotated

import typer

from advpipe.pipeline.cli.completion import words_of
from advpipe.pipeline.cli.shared import Answer, typed
from advpipe.pipeline.core.progress import with_progress, working_on

SIMULATORS = ("carla",)


@with_progress("checking {simulator}")
def check_command(
    simulator: Annotated[
        str,
        typer.Argument(help=f"What to check: {', '.join(SIMULATORS)}.", autocompletion=words_of(SIMULATORS)),
    ],
    server: Annotated[str, typer.Option(help="host:port of the server.")] = "localhost:2000",
) -> Answer:
    """Try what a drive needs of a running simulator, one line a check; exit code 1 if one fails.

    It spawns two cars and nine sensors on the loaded map, and leaves the server as it was.
    """
    from pydantic import ValidationError

    from advpipe.pipeline.core.errors import UsageError
    from advpipe.pipeline.core.nearest import known_names
    from advpipe.pipeline.core.short_repr import short_repr
    from advpipe.pipeline.scenario.carla import Carla

    if simulator not in SIMULATORS:
        raise UsageError(
            f"simulator {short_repr(simulator)} is unknown; {known_names(simulator, SIMULATORS)}"
        )
    try:
        settings = Carla(server=server)
    except ValidationError:
        raise UsageError(f"--server {short_repr(server)}: write host:port, such as localhost:2000") from None
    with working_on("loading libraries"):
        from advpipe.stages.simulate.world.carla.check import CarlaCheck
    findings = CarlaCheck(settings).run()

    def show() -> None:
        for finding in findings:
            print(finding)

    is_good = all(finding.is_good for finding in findings)
    return Answer(
        {"simulator": simulator, "checks": [vars(finding) for finding in findings]},
        show,
        exit_code=0 if is_good else 1,
        next_commands=[typed("simulate", "smoke", "--set", "world=carla")] if is_good else (),
    )
