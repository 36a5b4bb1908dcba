"""Whether V2X message labels state exactly which attacker changed which message, how and when."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from advpipe.pipeline.core.bounded_parquet import flat_columns, rows
from advpipe.pipeline.labels.message_quantities import MESSAGE_QUANTITIES
from advpipe.pipeline.labels.messages import ADDED, FILE, MESSAGE_COLUMNS, NEWER_COLUMNS
from advpipe.pipeline.messages.topics import V2X_SENT
from advpipe.pipeline.messages.v2x import sent_of_message
from advpipe.stages.verify.attackers import DeclaredAttackers
from advpipe.stages.verify.checks.attacked import AttackedBag
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.declared_bounds import unmeasurable
from advpipe.stages.verify.message_bounds import too_many_added
from advpipe.stages.verify.message_labels import MessageLabels
from advpipe.stages.verify.message_store import MessageStore
from advpipe.stages.verify.result import NOT_DECLARED, Fault, Result, Unchecked


class CamsCheck(BagCheck):
    """Compares the sent messages of both bags by their numbers; see `message_labels`.

    Receptions, Local Dynamic Maps and statistics are not recomputed.
    """

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        attacked = AttackedBag(self.bag, self.bag.parent)
        path = attacked.table(FILE)
        where = self.bag.subject.place(path)
        if V2X_SENT.name not in attacked.clean.topics or not attacked.has_v2x:
            return
        if not path.is_file():
            yield Fault(where, "is missing, though messages were attacked")
            return
        yield Unchecked(
            self.bag.place, "receptions of attacked messages, LDMs and V2X statistics are not recomputed"
        )
        try:
            with closing(MessageStore()) as store:
                yield from self._compare(attacked, path, store)
        except sqlite3.OperationalError as error:  # the disk is full
            yield Unchecked(where, f"not compared, as there is no room for temporary files: {error}")
        except sqlite3.Error:
            yield Fault(where, "holds message numbers that no bag can have")

    def _compare(self, attacked: AttackedBag, path: Path, store: MessageStore) -> Iterator[Result]:
        where, topic = self.bag.subject.place(path), f"{self.bag.place} {V2X_SENT.name}"
        attackers = DeclaredAttackers(attacked.clean, attacked.on_messages, attacked.start_ns, attacked.seed)
        for name, reader in (("clean", attacked.clean), ("forged", attacked.adversarial)):
            for _, message in reader.messages(V2X_SENT.name) if V2X_SENT.name in reader.topics else ():
                sent = sent_of_message(message)
                if not store.add("clean" if name == "clean" else "forged", sent):
                    yield Fault(topic, f"the {name} bag has two messages with number {sent.number}")
        known = flat_columns(path)
        columns = [name for name in MESSAGE_COLUMNS if name not in NEWER_COLUMNS or name in known]
        if missing := [name for name in NEWER_COLUMNS if name not in known]:
            yield Unchecked(where, f"{' and '.join(missing)}: not in the form of this version")
        for row in rows(path, columns):
            index = attackers.index(row["attack"], row["station_id"])
            store.add_label(index, row)
            if row["action"] == ADDED:
                store.add_added(index, row)
        reacts = any(one.spec.dcc_reacts for one in attacked.on_messages)
        labels = MessageLabels(store, attackers, reacts)
        if attackers.undeclared:
            names = ", ".join(attackers.undeclared)
            yield Unchecked(where, f"parts, bounds, mattered and untrue fields of {names} {NOT_DECLARED}")
        for one in attacked.on_messages:
            for terms in (one.declared, *one.declared.parts) if one.declared and one.family == "v2x" else ():
                yield from unmeasurable(self.bag.place, one.spec.type, terms.bounds, MESSAGE_QUANTITIES)
        for diff in store.diffs():
            if diff.labels:
                yield from (
                    Fault(where, f"message {diff.number} {what}") for what in labels.first_fault(diff)
                )
            elif diff.forged is not None and diff.forged != diff.clean:
                yield Fault(topic, f"message {diff.number} differs from the clean bag's and has no label")
            elif (
                diff.clean is not None
                and diff.forged is None
                and not labels.is_held_back(diff.clean.station_id)
            ):
                yield Fault(topic, f"message {diff.number} of the clean bag is missing without a label")
        for number, what in too_many_added(store, attackers):
            yield Fault(where, f"message {number}: {what}")
        if labels.chained:
            yield Unchecked(
                where,
                f"{labels.chained} messages were changed by several attacks; their states in between "
                "are not checked",
            )
