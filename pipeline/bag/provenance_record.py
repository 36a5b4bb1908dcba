"""What the provenance record of a bag says: strings, some of them JSON. Anybody may have written it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from advpipe.pipeline.core.document import (
    LONGEST_TEXT,
    Count,
    Document,
    ShortText,
    Text,
    read_json,
    validated,
)
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.declaration import Declaration, Family

MOST_LOOKS = 10_000
"""At more tries no attack looks; an evaluation draws as many random ones."""
_MOST_KEYS = 200
_MOST_ATTACKS = 1000
_JSON = ("versions", "parameters", "attacks", "lidar_topics", "looks", "baseline_tries", "recovered", "debug")
_HINT = "make the bag again"

Line = Annotated[str, Field(max_length=10_000)]


class RecordedAttack(Document):
    """One attack of a bag, with every default filled in. `values` has the keys that are not here too.

    declared: what it says of itself; None in a bag of a version before there were declarations.
    """

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)

    type: ShortText
    parameters: dict[ShortText, Any] = Field(default_factory=dict)
    victim: ShortText | None = None
    lidar: ShortText | None = None
    detector: Line | None = None
    attackers: dict[ShortText, Any] | None = None
    schedule: dict[ShortText, Any] | None = None
    declared: Declaration | None = None

    @property
    def family(self) -> Family:
        """What it attacks. In an older bag, it follows from the keys of each family."""
        if self.declared is not None:
            return self.declared.family
        given = self.model_fields_set | set(self.model_extra or {})
        if given & {"detector", "detector_sha256", "recipe", "frames"}:
            return "lidar"
        return "v2x" if given & {"attackers", "dcc_reacts"} else "gnss"

    @property
    def values(self) -> dict[str, Any]:
        """All that is written of it, as plain values."""
        return self.model_dump(exclude_unset=True)


class ProvenanceFields(Document):
    """The record by its keys; what is not there has its default."""

    kind: ShortText = ""
    scenario_name: ShortText = ""
    scenario: Text = ""
    source: Text = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    map_sha256: ShortText = ""
    versions: dict[ShortText, ShortText] = Field(default_factory=dict)
    parent_sha256: ShortText | None = None
    attack: Line = ""
    recipe: Line = ""
    parameters: dict[ShortText, Any] | list[Any] = Field(default_factory=dict)
    budget: ShortText = ""
    frames: ShortText = ""
    code_sha256: ShortText = ""
    attacks: Annotated[tuple[RecordedAttack, ...], Field(max_length=_MOST_ATTACKS)] = ()
    lidar_topics: Annotated[tuple[Line, ...], Field(max_length=_MOST_ATTACKS)] = ()
    looks: Annotated[int, Field(strict=True, ge=1, le=MOST_LOOKS)] | None = None
    baseline_tries: Annotated[int, Field(strict=True, ge=1, le=MOST_LOOKS)] | None = None
    detector: Line = ""
    detector_sha256: Line = ""
    device: ShortText = ""
    debug: bool = False
    recovered: dict[ShortText, Count] = Field(default_factory=dict)


class Provenance(Mapping[str, str]):
    """The record as it is written, a mapping of strings, and what it says.

    fields: the same as typed values, with bounds. parameters: of the attack; none of a coordinated one.
    """

    def __init__(self, record: Mapping[str, str], place: str = "the provenance record") -> None:
        """Raises AdvpipeError, which begins with `place`, for a record that is none."""
        self._record = dict(record)
        if len(self._record) > _MOST_KEYS or sum(map(len, self._record.values())) > 4 * LONGEST_TEXT:
            raise AdvpipeError(f"{place} is too large; {_HINT}")
        for key, text in self._record.items():
            if "\0" in key + text:
                raise AdvpipeError(f"{place}: {key[:40]!r} has a NUL character; {_HINT}")
        values: dict[str, Any] = dict(self._record)
        for key in values.keys() & set(_JSON):
            values[key] = read_json(self._record[key], Any, f"{place}: {key}", _HINT)
        self.fields: ProvenanceFields = validated(values, ProvenanceFields, place, _HINT)

    @property
    def is_attack(self) -> bool:
        """Whether the record is that of an adversarial bag."""
        return self.fields.kind == "attack"

    @property
    def parameters(self) -> dict[str, Any]:
        """The attack's parameters by name; empty where the record has none."""
        found = self.fields.parameters
        return found if isinstance(found, dict) else {}

    def __getitem__(self, key: str) -> str:
        return self._record[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._record)

    def __len__(self) -> int:
        return len(self._record)

    def __repr__(self) -> str:
        return f"Provenance({self._record!r})"
