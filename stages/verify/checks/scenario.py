"""Whether scenario.yaml, source.yaml, attack.yaml and /scenario/info agree with the bag's provenance."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import yaml

from advpipe.pipeline.core import plain_json
from advpipe.pipeline.core.plain_yaml import LIMIT_BYTES, load_yaml
from advpipe.pipeline.dataset.layout import SCENARIO_NAME, SOURCE_NAME
from advpipe.pipeline.messages.topics import SCENARIO_INFO
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.result import Fault, Result, Unchecked
from advpipe.stages.verify.subject import Subject

ATTACK_NAME = "attack.yaml"
_HIDDEN = ("kind", "scenario")  # keys that attack.yaml omits


class ScenarioFiles(MessageCheck):
    """Compares the files with the provenance; those that advpipe wrote, byte for byte."""

    def see(self, view: MessageView) -> Iterator[Result]:
        if view.raw.topic.name != SCENARIO_INFO.name or self.bag.scenario is None or view.message is None:
            return
        try:
            document = plain_json.load_json(view.message.data)
        except (ValueError, RecursionError):
            document = None
        if document != self.bag.scenario and document != {}:
            yield Fault(view.where, "differs from the scenario in the bag's provenance")

    def check(self) -> Iterator[Result]:
        subject, provenance = self.bag.subject, self.bag.provenance
        # For another drive beside the clean one, only its own provenance counts.
        is_clean = subject.layout is not None and self.bag.path == subject.layout.clean
        if is_clean and "scenario" in provenance:
            yield from self._same_text(subject, SCENARIO_NAME, provenance["scenario"])
        if is_clean and "source" in provenance:
            yield from self._same_text(subject, SOURCE_NAME, provenance["source"])
        if self.bag.is_attack and self.bag.path.is_dir():
            yield from self._attack_file()

    def _same_text(self, subject: Subject, name: str, text: str) -> Iterator[Result]:
        path = subject.root / name
        if not path.is_file():
            yield self._missing(name)
        elif path.stat().st_size > LIMIT_BYTES or path.read_bytes() != text.encode():
            what = "scenario" if name == SCENARIO_NAME else "source"
            yield Fault(name, f"differs from the {what} in {self.bag.place}")

    def _missing(self, where: str) -> Result:
        """A fault without a checksum list; with a list, `Checksums` reports missing files."""
        return Unchecked(where, "was not shared") if self.bag.subject.has_sums else Fault(where, "is missing")

    def _attack_file(self) -> Iterator[Result]:
        path = self.bag.path / ATTACK_NAME
        where = self.bag.subject.place(path)
        if not path.is_file():
            yield self._missing(where)
            return
        try:
            text = path.read_bytes()[: LIMIT_BYTES + 1].decode()
            document = load_yaml(text)
        except (yaml.YAMLError, ValueError, RecursionError):
            yield Fault(where, "is not valid YAML")
            return
        provenance = {key: text for key, text in self.bag.provenance.items() if key not in _HIDDEN}
        is_same = (
            isinstance(document, dict)
            and document.keys() == provenance.keys()
            and all(_equals(document[key], provenance[key]) for key in provenance)
        )
        if not is_same or yaml.safe_dump(document, sort_keys=True) != text:
            yield Fault(where, "differs from the attack in the bag's provenance")


def _equals(value: Any, text: str) -> bool:
    """Whether a value equals a record's text, as it is or as JSON."""
    if value == text:
        return True
    try:
        return bool(plain_json.load_json(text) == value)
    except (ValueError, RecursionError):
        return False
