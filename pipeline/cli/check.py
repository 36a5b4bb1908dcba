"""The command that tries what advpipe relies on in another simulator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Protocol

import typer

from advpipe.pipeline.cli.completion import words_of
from advpipe.pipeline.cli.shared import Answer, typed
from advpipe.pipeline.core.progress import with_progress, working_on

SIMULATORS = ("carla", "artery")
USE = {"carla": "world=carla", "artery": "v2x.network=artery"}


class Finding(Protocol):
    """One check, and whether all is as a drive needs it."""

    @property
    def is_good(self) -> bool:
        """Whether it is."""
        ...


@with_progress("checking {simulator}")
def check_command(
    simulator: Annotated[
        str,
        typer.Argument(help=f"What to check: {', '.join(SIMULATORS)}.", autocompletion=words_of(SIMULATORS)),
    ],
    server: Annotated[str, typer.Option(help="host:port of CARLA's server.")] = "localhost:2000",
    program: Annotated[
        str | None, typer.Option(help="Path of advpipe-artery; by default ADVPIPE_ARTERY_BIN or the PATH.")
    ] = None,
) -> Answer:
    """Try what a drive needs of another simulator, one line a check; exit code 1 if one fails.

    CARLA runs already: two cars and nine sensors are spawned on the loaded map, and the server is left as it
    was. Artery is started for a drive of five seconds.
    """
    from advpipe.pipeline.core.errors import UsageError
    from advpipe.pipeline.core.nearest import known_names
    from advpipe.pipeline.core.short_repr import short_repr

    if simulator not in SIMULATORS:
        raise UsageError(
            f"simulator {short_repr(simulator)} is unknown; {known_names(simulator, SIMULATORS)}"
        )
    findings = _carla(server) if simulator == "carla" else _artery(program)

    def show() -> None:
        for finding in findings:
            print(finding)

    is_good = all(finding.is_good for finding in findings)
    return Answer(
        {"simulator": simulator, "checks": [vars(finding) for finding in findings]},
        show,
        exit_code=0 if is_good else 1,
        next_commands=[typed("simulate", "smoke", "--set", USE[simulator])] if is_good else (),
    )


def _carla(server: str) -> Sequence[Finding]:
    from pydantic import ValidationError

    from advpipe.pipeline.core.errors import UsageError
    from advpipe.pipeline.core.short_repr import short_repr
    from advpipe.pipeline.scenario.carla import Carla

    try:
        settings = Carla(server=server)
    except ValidationError:
        raise UsageError(f"--server {short_repr(server)}: write host:port, such as localhost:2000") from None
    with working_on("loading libraries"):
        from advpipe.stages.simulate.world.carla.check import CarlaCheck
    return CarlaCheck(settings).run()


def _artery(program: str | None) -> Sequence[Finding]:
    from advpipe.pipeline.scenario.artery import Artery

    with working_on("loading libraries"):
        from advpipe.stages.simulate.artery_check import check_artery
    return check_artery(Artery(program=program))
