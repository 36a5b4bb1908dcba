"""The connection to SUMO: in this process (libsumo), or to a server that others may share (TraCI).

Only this module and `server` import libsumo or traci.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from advpipe.pipeline.scenario.traffic import SumoServer
from advpipe.stages.simulate.traffic.protocol import TrafficError
from advpipe.stages.simulate.traffic.sumo.server import Server, connect


class SumoConnection:
    """One SUMO simulation, from `start` to `close`.

    Its domains have the methods of TraCI's, whatever the transport:
    https://sumo.dlr.de/docs/TraCI/Protocol.html
    """

    def __init__(self, transport: Literal["libsumo", "traci"], server: SumoServer, scratch: Path) -> None:
        self._transport, self._settings, self._scratch = transport, server, scratch
        self._client: Any = None
        self._server: Server | None = None

    @property
    def vehicle(self) -> Any:
        """TraCI's domain `vehicle`."""
        return self._client.vehicle

    @property
    def route(self) -> Any:
        """TraCI's domain `route`."""
        return self._client.route

    @property
    def edge(self) -> Any:
        """TraCI's domain `edge`."""
        return self._client.edge

    @property
    def vehicletype(self) -> Any:
        """TraCI's domain `vehicletype`."""
        return self._client.vehicletype

    @property
    def simulation(self) -> Any:
        """TraCI's domain `simulation`."""
        return self._client.simulation

    @property
    def trafficlight(self) -> Any:
        """TraCI's domain `trafficlight`."""
        return self._client.trafficlight

    @property
    def refusals(self) -> tuple[type[Exception], ...]:
        """The exceptions that SUMO raises for a single command that it cannot carry out."""
        if self._transport == "libsumo":
            import libsumo

            return (libsumo.TraCIException,)
        import traci

        return (traci.exceptions.TraCIException,)

    def start(self, options: Sequence[str]) -> None:
        """Start SUMO with command-line options, or join the server that the scenario names.

        Raises AdvpipeError if it cannot start; nothing is left running then.
        """
        with self.errors():
            if self._transport == "libsumo":
                import libsumo

                libsumo.start(["sumo", *options])
                self._client = libsumo
            else:
                self._server = connect(self._settings, options, self._scratch / "sumo.log")
                self._client = self._server.client

    def simulate_step(self) -> None:
        """Simulate one step; a shared server waits until all its clients have requested it."""
        self._client.simulationStep()

    def close(self, *, after_error: bool = False) -> None:
        """End SUMO, unless another program started it as a server; do nothing if none runs.

        after_error: SUMO may no longer respond, so a server of ours is killed.
        """
        client, self._client = self._client, None
        if self._server is not None:
            self._server.close(after_error)
        elif client is not None:
            client.close()

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Convert SUMO's exceptions to a one-line TrafficError."""
        try:
            yield
        except (*self.refusals, *self._fatal()) as error:
            reason = (self._server.exit_reason() if self._server is not None else None) or error
            raise TrafficError(f"SUMO cannot continue with this network or traffic: {reason}") from None

    def _fatal(self) -> tuple[type[Exception], ...]:
        if self._transport == "libsumo":
            import libsumo

            return (libsumo.FatalTraCIError,)
        import traci

        return (traci.exceptions.FatalTraCIError, ConnectionError)
