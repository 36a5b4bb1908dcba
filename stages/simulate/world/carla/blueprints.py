"""The blueprint of each body: by class and size, as measured in the running server."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import suggestion
from advpipe.pipeline.core.verbosity import notice
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.world.carla.poses import ActorBox
from advpipe.stages.simulate.world.carla.session import Session

PEDESTRIAN = "pedestrian"

BASE_TYPES: Mapping[str, tuple[str, ...]] = {
    "van": ("van", "truck", "car"),
    "minibus": ("van", "bus", "truck"),
    "box_truck": ("truck", "van"),
    "semi_trailer": ("truck", "bus"),
    "bus": ("bus", "truck", "van"),
    "motorcycle": ("motorcycle", "bicycle"),
    "scooter": ("motorcycle", "bicycle"),
    "bicycle": ("bicycle", "motorcycle"),
}
"""CARLA's `base_type` for a body of that name, and what replaces it where the server has none."""

BASE_TYPES_OF_LABEL: Mapping[str, tuple[str, ...]] = {
    "car": ("car",),
    "truck": ("truck", "van", "bus"),
    "cyclist": ("bicycle", "motorcycle"),
    "pedestrian": (PEDESTRIAN,),
}
"""The same for other bodies, by their class."""

LABELS_OF_BASE_TYPE: Mapping[str, str] = {
    "car": "car",
    "van": "truck",
    "truck": "truck",
    "bus": "truck",
    "motorcycle": "cyclist",
    "bicycle": "cyclist",
    PEDESTRIAN: "pedestrian",
}

SAMPLE_HEIGHT_M, SAMPLE_SPACING_M = 300.0, 40.0
"""Samples stand in the air over the map's origin, where nothing else is."""


def base_type_of(blueprint: Any) -> str:
    """CARLA's class of a blueprint or an actor's attributes; a car if it states none."""
    if blueprint.id.startswith("walker."):
        return PEDESTRIAN
    return (
        str(blueprint.get_attribute("base_type").as_str()) if blueprint.has_attribute("base_type") else "car"
    )


class Blueprints:
    """given: blueprints by the name of a body or variant, as the scenario has them.

    Raises UsageError for one that the server lacks.
    """

    def __init__(self, library: Any, given: Mapping[str, str]) -> None:
        self._library, self._given = library, given
        known = sorted(blueprint.id for blueprint in library)
        for body, blueprint in given.items():
            if blueprint not in known:
                hint = suggestion(blueprint, known)
                raise UsageError(
                    f"carla.blueprints.{body} {blueprint!r} is not a blueprint of the server"
                    f"{'; ' if hint else ''}{hint}"
                )
        self._boxes: dict[str, ActorBox] = {}
        self._by_type: dict[str, list[str]] = {}
        self._chosen: dict[str, str | None] = {}
        self._unknown: set[str] = set()

    def measure(self, client: Any, session: Session, variants: Iterable[Variant]) -> None:
        """Spawn a sample of each blueprint that these bodies may get, in the air, and note their boxes.

        CARLA's library states no sizes. It takes two ticks.
        """
        import carla

        wanted = {base for variant in variants for base in _base_types(variant)} | {"car"}
        samples = [one for one in self._library if self._is_candidate(one, wanted)]
        batch = []
        for index, blueprint in enumerate(samples):
            row, column = divmod(index, 16)
            place = carla.Location(SAMPLE_SPACING_M * column, SAMPLE_SPACING_M * row, SAMPLE_HEIGHT_M)
            freeze = carla.command.SetSimulatePhysics(carla.command.FutureActor, False)
            batch.append(carla.command.SpawnActor(blueprint, carla.Transform(place)).then(freeze))
        answers = client.apply_batch_sync(batch, False)
        session.tick()
        found = {
            answer.actor_id: blueprint
            for answer, blueprint in zip(answers, samples, strict=True)
            if not answer.has_error()
        }
        for actor in session.world.get_actors(list(found)):
            self._boxes[actor.type_id] = ActorBox.of(actor.bounding_box)
            self._by_type.setdefault(base_type_of(found[actor.id]), []).append(actor.type_id)
        client.apply_batch_sync([carla.command.DestroyActor(actor) for actor in found], False)
        session.tick()

    def box(self, blueprint: str) -> ActorBox:
        """The measured box of a blueprint of `choose`."""
        return self._boxes[blueprint]

    def choose(self, variant: Variant) -> str | None:
        """The blueprint for a body; None, with a notice, where the server has none of its class."""
        if variant.name not in self._chosen:
            self._chosen[variant.name] = self._nearest(variant)
        return self._chosen[variant.name]

    def definition(self, blueprint: str, role_name: str) -> Any:
        """The `carla.ActorBlueprint`, with a role name."""
        definition = self._library.find(blueprint)
        if definition.has_attribute("role_name"):
            definition.set_attribute("role_name", role_name)
        return definition

    def _nearest(self, variant: Variant) -> str | None:
        given = self._given.get(variant.name) or self._given.get(variant.body.name)
        if given is not None and given in self._boxes:
            return given
        size_m = np.array([variant.length_m, variant.width_m, variant.height_m])
        for base in _base_types(variant):
            if names := sorted(self._by_type.get(base, ())):
                return min(names, key=lambda name: float(np.abs(self._boxes[name].sizes_m - size_m).sum()))
        if variant.body.name not in self._unknown:
            self._unknown.add(variant.body.name)
            notice(
                f"CARLA has no blueprint for the body {variant.body.name}, so such road users are not seen; "
                f"name one with carla.blueprints.{variant.body.name}"
            )
        return None

    def _is_candidate(self, blueprint: Any, wanted: set[str]) -> bool:
        if blueprint.id in self._given.values():
            return True
        if not blueprint.id.startswith(("vehicle.", "walker.pedestrian.")):
            return False
        special = "special_type"
        is_emergency = (
            blueprint.has_attribute(special) and blueprint.get_attribute(special).as_str() == "emergency"
        )
        return base_type_of(blueprint) in wanted and not is_emergency


def _base_types(variant: Variant) -> tuple[str, ...]:
    return BASE_TYPES.get(variant.body.name) or BASE_TYPES_OF_LABEL[variant.body.label]
