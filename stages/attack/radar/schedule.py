"""The attacks on one radar, each applied to the scans of its schedule, with what they did to each return."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.recorded_radars import RecordedRadar
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.quantity import Range, excesses
from advpipe.pipeline.labels.scan_quantities import SCAN_QUANTITIES, ScanChange
from advpipe.pipeline.labels.scans import ADDED, CHANGED, MEASURED, REMOVED
from advpipe.pipeline.messages.radar import RETURN_DTYPE, RadarReturns
from advpipe.pipeline.scenario.acting import Acting, acting_on_messages
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.parameters import resolved_parameters
from advpipe.stages.attack.radar.base import AttackedScan, ScanAttacker, ScanContext
from advpipe.stages.attack.radar.registry import RADAR_ATTACKS
from advpipe.stages.attack.recording import RecordedTimes

Row = dict[str, object]


@dataclass
class _ScheduledScanAttack:
    """One attack, and the start of its current span of attacked scans.

    target: the id of the road user that it names, "" for none. met: those that were there, where it looked.
    """

    spec: AttackSpec
    target: str
    bounds: Mapping[str, Range]
    attacker: ScanAttacker
    is_active: Acting
    begin_ns: int | None = None
    met: set[str] = field(default_factory=set)

    def met_by(self, boxes: Callable[[], Boxes]) -> Callable[[], Boxes]:
        """The same road users, which it remembers to have met."""

        def remembered() -> Boxes:
            found = boxes()
            self.met.update(found.ids)
            return found

        return remembered


@dataclass
class _Touched:
    """A scan on its way through the attacks.

    source: (K,), index of each return in the clean scan, -1 of an added one. by: (K,), the attack that
    changed or added it last, "" for none. removed: clean index and attack.
    """

    returns: RadarReturns
    source: npt.NDArray[np.int64]
    by: list[str]
    removed: list[tuple[int, str]] = field(default_factory=list)

    def apply(self, attack: str, result: AttackedScan) -> ScanChange:
        """Take what one attack made of it, in the order of the radar: by range, where it sorts by it."""
        result = _as_sorted(result, self.returns)
        kept = result.source >= 0
        same = np.zeros(len(result.source), bool)
        same[kept] = result.returns[kept] == self.returns[result.source[kept]]
        gone = np.setdiff1d(np.arange(len(self.returns)), result.source[kept])
        self.removed += [(int(self.source[one]), attack) for one in gone if self.source[one] >= 0]
        self.by = [
            self.by[before] if unchanged else attack
            for before, unchanged in zip(result.source.tolist(), same.tolist(), strict=True)
        ]
        self.source = np.where(kept, self.source[result.source], -1) if len(self.source) else result.source
        self.returns = result.returns
        return ScanChange(int((~kept).sum()), len(gone), int((kept & ~same).sum()))


def _as_sorted(result: AttackedScan, before: RadarReturns) -> AttackedScan:
    """The attacked scan by range, if the scan before was; a place at the end would tell what was added."""
    if not (np.diff(before["range"]) >= 0).all():
        return result
    order = np.argsort(result.returns["range"], kind="stable")
    return AttackedScan(result.returns[order], result.source[order])


class ScanAttackSchedule:
    """All attacks on one radar, in the order of the request; call `of` for each of its scans in order.

    Raises AdvpipeError for a bad parameter and for a schedule that begins after the recording.
    """

    def __init__(
        self, recorded: RecordedRadar, specs: Sequence[AttackSpec], recording: RecordedTimes, seed: int
    ) -> None:
        self.recorded = recorded
        self._attacks: list[_ScheduledScanAttack] = []
        for spec in specs:
            recording.refuse_outside(spec)
            attack_class = RADAR_ATTACKS.find(spec.type)
            attack = attack_class(**resolved_parameters(spec, attack_class))
            names = ("attack", spec.type, spec.seed_name, recorded.scan_topic)
            attacker = attack.begin(named_generator(seed, *names))
            acts = acting_on_messages(spec, recording.start_ns, seed)
            target = str(getattr(attack, "target", ""))
            self._attacks.append(_ScheduledScanAttack(spec, target, attack.bounds, attacker, acts))

    def of(
        self, time_ns: int, returns: RadarReturns, boxes: Callable[[], Boxes]
    ) -> tuple[RadarReturns, list[Row]]:
        """The scan that the attacks make of a clean one (N,), and a row for each touched return.

        Raises AdvpipeError for a scan beyond the bounds that an attack declares.
        """
        touched = _Touched(returns, np.arange(len(returns)), [""] * len(returns))
        for attack in self._attacks:
            if not attack.is_active(time_ns):
                attack.begin_ns = None
                continue
            attack.begin_ns = time_ns if attack.begin_ns is None else attack.begin_ns
            elapsed_s = (time_ns - attack.begin_ns) / 1e9
            context = ScanContext(self.recorded.radar, elapsed_s, attack.met_by(boxes))
            change = touched.apply(attack.spec.type, attack.attacker(touched.returns, context))
            for excess in excesses(change, attack.bounds, SCAN_QUANTITIES):
                raise AdvpipeError(f"{attack.spec.type} went beyond its bounds: {excess}")
        return touched.returns, list(_rows(returns, touched))

    def refuse_unmet_targets(self) -> None:
        """To be called after the last scan. Raises UsageError for a target that was in none of them."""
        for attack in self._attacks:
            if attack.target and attack.target not in attack.met:
                raise UsageError(
                    f"{attack.spec.type}: no attacked scan of {self.recorded.scan_topic} has a road user "
                    f"{short_repr(attack.target)}; {known_names(attack.target, sorted(attack.met))}"
                )


def _rows(clean: RadarReturns, touched: _Touched) -> Iterator[Row]:
    for index, attack in sorted(touched.removed):
        yield {"attack": attack, "action": REMOVED, "clean": index, **_values(clean[index])}
    for place, (attack, source) in enumerate(zip(touched.by, touched.source.tolist(), strict=True)):
        if attack:
            row: Row = {"attack": attack, "action": ADDED if source < 0 else CHANGED, "attacked": place}
            yield row | {"clean": None if source < 0 else source} | _values(touched.returns[place])


def _values(one: np.void) -> Row:
    names = RETURN_DTYPE.names or ()
    return {column: float(one[name]) for column, name in zip(MEASURED, names, strict=True)}
