"""The section `attacks`: who attacks whom, when and how. The command line builds it from its options."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    StringConstraints,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import CoreSchema, core_schema

from advpipe.pipeline.core.attack_options import AttackOptions
from advpipe.pipeline.core.bounds import DriveTimeS, HeightM, PlaceM, ShareOfSome
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.core.lidar_height import HIGHEST_M, LOWEST_M
from advpipe.pipeline.core.options import parser_options
from advpipe.pipeline.core.section import NotNegative, Number, Reference, Section, Switch
from advpipe.pipeline.core.short_repr import short_repr, shorten

NS_PER_S = 1_000_000_000
BagName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=80)]
"""The name of an adversarial bag: a folder beside the clean bag."""

Value = Any
"""A parameter of an attack: a number, a string, true, false, null, or a list of those."""

Credentials = Literal["ticket", "none", "untrusted", "expired", "stolen"]
"""What attackers sign with: a valid ticket, as insiders; or nothing that receivers accept, as outsiders."""

RadioOf = Literal["embedded", "artery"]
"""Whose radio medium sends the messages of a recorded drive again."""

LARGEST_NUMBER = 1e15
"""The largest absolute value of a parameter: larger ones lose digits in double precision."""

LONGEST_TEXT = 4096
MOST_ITEMS, MOST_LEVELS = 10_000, 2


def _help(name: str) -> str:
    text: str = parser_options(AttackOptions, name)["help"]
    return text


def _shared(name: str, note: str = "", **bounds: Any) -> Any:
    """A field that is also an option of `advpipe attack`, with the same default and help.

    note: appended to the help; the command line states it elsewhere.
    """
    return Field(getattr(AttackOptions, name), description=f"{_help(name)} {note}".strip(), **bounds)


class Schedule(Section):
    """When an attack acts. Times are seconds since the first message of the bag.

    `continuous`: all the time. `periodic`: for `on_s` at the start of every `period_s`; the first period
    starts at `from_s`. `random`: on each message or cloud independently, with `probability`.
    """

    from_s: NotNegative = _shared("from_s", le=1e6)
    to_s: DriveTimeS | None = _shared("to_s", "Excluded; the end of the recording if left out.")
    kind: Literal["continuous", "periodic", "random"] = "continuous"
    period_s: DriveTimeS | None = Field(None, description="length of a period of a periodic schedule")
    on_s: DriveTimeS | None = Field(
        None, description="time at the start of each period in which a periodic schedule acts"
    )
    probability: ShareOfSome | None = Field(
        None, description="probability with which a random schedule acts on a message or cloud"
    )

    @model_validator(mode="after")
    def _combinations(self) -> Schedule:
        if self.to_s is not None and self.to_s <= self.from_s:
            raise ValueError(f"to_s {self.to_s:g} is not after from_s {self.from_s:g}")
        for key, kind in (("period_s", "periodic"), ("on_s", "periodic"), ("probability", "random")):
            if (getattr(self, key) is not None) != (self.kind == kind):
                raise ValueError(
                    f"a {kind} schedule needs its {key}"
                    if self.kind == kind
                    else f"{key} is given, but kind is {self.kind}; set kind: {kind}"
                )
        if self.period_s is not None and self.on_s is not None and self.on_s > self.period_s:
            raise ValueError(f"on_s {self.on_s:g} is longer than period_s {self.period_s:g}")
        return self

    def active(self, t_s: float, rng: np.random.Generator) -> bool:
        """Whether the attack acts at `t_s`, to the nanosecond; a random schedule takes one draw per call."""
        t_ns, from_ns = round(t_s * NS_PER_S), round(self.from_s * NS_PER_S)
        hit = self.probability is None or rng.random() < self.probability
        if t_ns < from_ns or (self.to_s is not None and t_ns >= round(self.to_s * NS_PER_S)):
            return False
        if self.period_s is not None and self.on_s is not None:
            return (t_ns - from_ns) % round(self.period_s * NS_PER_S) < round(self.on_s * NS_PER_S)
        return hit

    def overlaps(self, other: Schedule) -> bool:
        """Whether the intervals from `from_s` to `to_s` of both schedules overlap."""
        ends_s = [float("inf") if one.to_s is None else one.to_s for one in (self, other)]
        return self.from_s < ends_s[1] and other.from_s < ends_s[0]


class RoadsideUnit(Section):
    """A roadside station of the attacker, at a position in the map frame."""

    x_m: PlaceM
    y_m: PlaceM
    z_m: HeightM = Field(3.0, description="height of its antenna in the map frame")


class Attackers(Section):
    """The stations that send the false messages, by exactly one of these keys."""

    vehicles: tuple[Reference, ...] = Field(
        (), max_length=10_000, description="ids of the attackers in /v2x/stations"
    )
    share: ShareOfSome | None = Field(
        None, description="share of all stations that attack, drawn from the seed"
    )
    roadside_unit: RoadsideUnit | None = Field(None, description="a roadside station that attacks")

    @model_validator(mode="after")
    def _exactly_one(self) -> Attackers:
        if bool(self.vehicles) + (self.share is not None) + (self.roadside_unit is not None) != 1:
            raise ValueError("give exactly one of vehicles, share and roadside_unit")
        if len(set(self.vehicles)) < len(self.vehicles):
            raise ValueError("vehicles lists one vehicle twice")
        return self


class AttackSpec(Section):
    """One attack: its name, how it is carried out, when, by whom and on whom.

    The stage `attack` checks that the name is known and that the attack's family uses the keys that are set.
    """

    type: str = Field(
        pattern=r"^[A-Za-z_][A-Za-z0-9_.:-]*$", max_length=200, description=_help("type")
    )  # no default: a scenario names its attacks
    recipe: Reference | None = _shared("recipe", "For a LiDAR attack; its best recipe by default.")
    parameters: dict[Reference, Value] = Field(
        {}, max_length=1000, description="parameters of this attack by name"
    )
    schedule: Schedule = Schedule()
    attackers: Attackers | None = Field(None, description="the attackers of a V2X attack")
    victim: Reference | None = _shared("victim")
    seed_name: Reference = Field(
        "", description="a name from which random draws derive; attacks of different names draw differently"
    )
    dcc_reacts: Switch = _shared("dcc_reacts")
    credentials: Credentials = _shared("credentials")
    network: RadioOf = _shared("network")
    lidar: Reference | None = _shared("lidar")
    frames: Reference = _shared("frames", "For a LiDAR attack.")
    detector: str = _shared("detector", "The detector that a LiDAR attack targets.", max_length=4096)
    lidar_height_m: Number | None = _shared("lidar_height_m", ge=LOWEST_M, le=HIGHEST_M)
    level: Switch = _shared("level")
    scale_intensity: Number = _shared("scale_intensity", ge=1e-6, le=1e6)

    @field_validator("parameters")
    @classmethod
    def _plain(cls, parameters: dict[str, Value]) -> dict[str, Value]:
        return {name: _plain_value(name, value) for name, value in parameters.items()}

    @field_validator("frames", mode="before")
    @classmethod
    def _quoted(cls, frames: Any) -> Any:
        if isinstance(frames, int):  # YAML 1.1 has sexagesimal numbers: 0:30 is 30
            raise ValueError("is a number to YAML; write it in quotes, such as '0:30'")
        return frames

    @field_validator("frames")
    @classmethod
    def _frame_slice(cls, text: str) -> str:
        try:
            FrameSlice.parse(text)
        except AdvpipeError as error:
            raise ValueError(str(error)) from None
        return text

    @model_validator(mode="after")
    def _victim_is_no_attacker(self) -> AttackSpec:
        if self.attackers is not None and self.victim in self.attackers.vehicles:
            raise ValueError(f"{self.victim} is both attacker and victim of {self.type}; name another")
        return self


def _plain_value(name: str, value: Value, levels: int = 0) -> Value:
    """The value with lists as tuples. Raises ValueError for an infinite number and for no plain value."""
    if isinstance(value, (list, tuple)):
        if len(value) > MOST_ITEMS or levels > MOST_LEVELS:
            raise ValueError(f"{shorten(name)} holds more than {MOST_ITEMS} values or nests lists too deeply")
        return tuple(_plain_value(name, item, levels + 1) for item in value)
    if isinstance(value, (int, float)) and not abs(value) <= LARGEST_NUMBER:
        raise ValueError(
            f"{shorten(name)} is {short_repr(value)}; it must be finite and within {LARGEST_NUMBER:g}"
        )
    if isinstance(value, str) and len(value) > LONGEST_TEXT:
        raise ValueError(
            f"{shorten(name)} is a string of {len(value)} characters; at most {LONGEST_TEXT} are read"
        )
    if value is not None and not isinstance(value, (bool, int, float, str)):
        kind = type(value).__name__
        raise ValueError(f"{shorten(name)} is a {kind}; give a number, a string or a list of them")
    return value


class OneOrMany:
    """Marks a list with one item that may be written as the item alone."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def as_list(value: Any) -> Any:
            if value in ([], ()):
                raise ValueError("lists no attack")
            return [value] if isinstance(value, (dict, AttackSpec)) else value

        return core_schema.no_info_before_validator_function(as_list, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        many = {**handler(schema), "minItems": 1}
        return {"anyOf": [many["items"], many]}


BagAttacks = Annotated[tuple[AttackSpec, ...], OneOrMany()]
"""The attacks on one bag: one, or several that are carried out together."""

Attacks = dict[BagName, BagAttacks]
"""The adversarial bags by name."""


def attack_spec(keys: Mapping[str, Any]) -> AttackSpec:
    """An attack from keys of the scenario file. Raises AdvpipeError, one line, for an invalid value."""
    try:
        return AttackSpec.model_validate(keys)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(shorten(str(part)) for part in first["loc"])
        message = shorten(first["msg"].removeprefix("Value error, "), 1000)
        given = "" if isinstance(first["input"], dict) else f", not {short_repr(first['input'])}"
        raise AdvpipeError(f"attack: {f'{place}: ' if place else ''}{message}{given}") from None
