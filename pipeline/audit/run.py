"""Audit data sets: does anything but the attack itself tell attacked units from clean ones?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from advpipe.pipeline.audit.bag_units import bag_units
from advpipe.pipeline.audit.implied import implied
from advpipe.pipeline.audit.probe import Float64, Probe, Unit
from advpipe.pipeline.audit.probe_model import ProbeModel, untrained
from advpipe.pipeline.audit.registry import PROBES
from advpipe.pipeline.audit.result import Audit, ProbeResult, or_none
from advpipe.pipeline.audit.roc_area import Int64, roc_area
from advpipe.pipeline.audit.units import Units, joined_units
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.provenance_record import Provenance, RecordedAttack
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.dataset.layout import read_layout

MOST_CLOUDS = 40
"""Clouds of a bag, at most, that are measured."""

MANY_DRIVES = 8
"""With at least so many drives, each is one cluster, instead of its seconds and stations."""


@dataclass(frozen=True)
class AuditedAttack:
    """An adversarial bag, measured. name: its attack and recipe. has_debug: whether it has debug topics.
    clean: the units of the bag from which it was made; none if that is not there."""

    name: str
    attacks: tuple[RecordedAttack, ...]
    has_debug: bool
    units: Mapping[Unit, Units]
    clean: Mapping[Unit, Units]


@dataclass(frozen=True)
class AuditedDrive:
    """A data set, measured."""

    name: str
    attacked: tuple[AuditedAttack, ...]


def audit(datasets: Sequence[Path], train: Sequence[Path] = (), *, most_clouds: int = MOST_CLOUDS) -> Audit:
    """Audit data sets, each a drive with attacks on it.

    Probes learn on the drives in `train`, and of several data sets on the others in turn, from bags of the
    same attack; where there are none, both directions are tried, and the intervals are corrected for that.
    Raises AdvpipeError for a folder that is no data set, a damaged bag, and data sets without an attack.
    """
    paths = [*datasets, *train]
    if len({path.resolve() for path in paths}) < len(paths):
        raise UsageError("a data set is given twice; probes learn on other drives than they judge")
    layouts = [read_layout(path) for path in paths]
    for layout in layouts:
        layout.refuse_running()
    if not any(layout.attacks for layout in layouts[: len(datasets)]):
        raise UsageError(f"{datasets[0]} holds no adversarial bag; `advpipe attack` makes one")
    drives = [
        _measured(str(path), [layout.clean, *layout.attacks], most_clouds)
        for path, layout in zip(paths, layouts, strict=True)
    ]
    judged, others = drives[: len(datasets)], drives[len(datasets) :]
    results: list[ProbeResult] = []
    unchecked: dict[str, str] = {}
    for name in dict.fromkeys(each.name for drive in judged for each in drive.attacked):
        found = list(_results(name, judged, others))
        results += found
        if not found:
            unchecked[name] = "it touched nothing that a probe sees"
    return Audit(tuple(map(str, datasets)), tuple(map(str, train)), tuple(results), unchecked)


def _measured(name: str, bags: Sequence[Path], most_clouds: int) -> AuditedDrive:
    about = {path: BagReader(path).provenance for path in bags}
    attacks = [path for path in bags if about[path].is_attack]
    parents = [path for path in bags if not about[path].is_attack]
    steps = iter(track([*parents, *attacks], f"measuring {name}", len(bags)))
    clean = {path: bag_units(path, most_clouds) for path, _ in zip(parents, steps, strict=False)}
    of_sha256 = {parent_sha256(path): clean[path] for path in parents} if len(parents) > 1 else {}
    attacked: list[AuditedAttack] = []
    for path in steps:
        stated = about[path].fields
        parent = of_sha256.get(stated.parent_sha256 or "", {}) if of_sha256 else clean[parents[0]]
        units = bag_units(path, most_clouds)
        attacked.append(AuditedAttack(_name(about[path]), stated.attacks, stated.debug, units, parent))
    return AuditedDrive(name, tuple(attacked))


def _name(provenance: Provenance) -> str:
    return " ".join(filter(None, (provenance.fields.attack, provenance.fields.recipe)))


def _results(
    name: str, judged: Sequence[AuditedDrive], others: Sequence[AuditedDrive]
) -> Iterator[ProbeResult]:
    """What each probe says of one attack, over all drives that have it."""
    rows = [(drive, one) for drive in judged for one in drive.attacked if one.name == name]
    touched = {unit for _, one in rows for unit, units in one.units.items() if units.is_attacked.any()}
    probes = [probe for probe in PROBES if probe.unit in touched]
    for probe in probes:
        parts = [
            (_compared(one, probe.unit), _model(probe, name, drive, [*judged, *others]))
            for drive, one in rows
            if probe.unit in one.units
        ]
        attacks = [attack for _, one in rows for attack in one.attacks]
        reason = implied(probe, attacks, has_debug=any(one.has_debug for _, one in rows))
        if (found := _judged(name, probe, parts, reason, len(probes))) is not None:
            yield found


def _compared(one: AuditedAttack, unit: Unit) -> Units:
    """The units of an adversarial bag, and those of the clean one from which it was made."""
    own = one.units[unit]
    return joined_units([own, one.clean[unit]]) if unit in one.clean else own


def _model(
    probe: Probe[Any], name: str, drive: AuditedDrive, drives: Sequence[AuditedDrive]
) -> ProbeModel | None:
    """What the probe learns on the other drives from bags of this attack."""
    parts = [
        _compared(one, probe.unit)
        for other in drives
        if other is not drive
        for one in other.attacked
        if one.name == name and probe.unit in one.units
    ]
    if not parts:
        return None
    units = joined_units(parts)
    return ProbeModel.learnt(units.values[probe.name], units.is_attacked)


def _judged(
    name: str,
    probe: Probe[Any],
    parts: Sequence[tuple[Units, ProbeModel | None]],
    reason: str,
    tests: int,
) -> ProbeResult | None:
    scores: list[Float64] = []
    clusters: list[Int64] = []
    is_trained = all(model is not None for _, model in parts)
    for number, (units, model) in enumerate(parts):
        values = units.values[probe.name]
        scores.append(model(values) if is_trained and model is not None else untrained(values))
        own = np.unique(units.cluster, return_inverse=True)[1].reshape(-1)
        clusters.append((number << 32) + (own if len(parts) < MANY_DRIVES else 0 * own))
    is_attacked = np.concatenate([units.is_attacked for units, _ in parts])
    if not any(np.isfinite(units.values[probe.name]).any() for units, _ in parts):
        return None
    cluster = np.unique(np.concatenate(clusters), return_inverse=True)[1].reshape(-1)
    area = roc_area(np.concatenate(scores), is_attacked, cluster, tests if is_trained else 2 * tests)
    if not is_trained and area.area < 0.5:
        area = area.reversed
    if np.isnan(area.area):
        return None
    return ProbeResult(
        name,
        probe.unit,
        probe.name,
        probe.meaning,
        area.area,
        or_none(area.low),
        or_none(area.high),
        area.attacked,
        area.clean,
        area.clusters,
        is_trained,
        reason,
    )
