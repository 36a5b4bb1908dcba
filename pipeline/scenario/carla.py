"""The section `carla`: the server of `world: carla`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from advpipe.pipeline.core.section import Positive, Reference, Section, Whole

Blueprint = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$", max_length=200)]

MOST_PORT = 65535


class Carla(Section):
    """A CARLA server that runs already; used only with `world: carla`."""

    server: str = Field(
        "localhost:2000", pattern=r"^[A-Za-z0-9.-]{1,253}:[0-9]{1,5}$", description="host:port of the server"
    )
    map: Reference | None = Field(
        None,
        description="one of the server's maps, such as Town06; by default the one with the name of "
        "map.opendrive's file, or else a world that CARLA generates from the scenario's map",
    )
    timeout_s: Positive = Field(20.0, ge=1, le=600, description="longest wait for an answer of the server")
    blueprints: dict[Reference, Blueprint] = Field(
        {},
        max_length=1000,
        description="blueprint of each body, by name, such as {sedan: vehicle.tesla.model3}; others get "
        "the one of their class that is nearest in size",
    )
    traffic_manager_port: Whole = Field(
        8000,
        ge=1,
        le=MOST_PORT,
        description="port of the Traffic Manager, which drives vehicles of CARLA",
    )

    @field_validator("server")
    @classmethod
    def _port(cls, server: str) -> str:
        port = int(server.rpartition(":")[2])
        if not 0 < port <= MOST_PORT:
            raise ValueError(f"port {port} is not between 1 and {MOST_PORT}")
        return server
