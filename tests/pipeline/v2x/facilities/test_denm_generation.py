from __future__ import annotations

from collections.abc import Callable

from advpipe.pipeline.v2x.facilities.denm import EventKind, Termination, decode_denm
from advpipe.pipeline.v2x.facilities.denm_generation import CANCELLATIONS, DenmGenerator
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.section import DenmRules

START_NS, STEP_NS = 1_767_268_800_000_000_000, 100_000_000
METRE_DEG = 1 / 111_200


def drive(
    car: Callable[..., StationState], generator: DenmGenerator, steps: int, until: int, kind: EventKind
) -> list[tuple[int, bytes]]:
    """An event in the first `until` steps of a vehicle that drives 1 m north in each."""
    sent = []
    for step in range(steps):
        now_ns = START_NS + step * STEP_NS
        state = car(time_ns=now_ns, latitude_deg=48 + step * METRE_DEG)
        generator.update(now_ns, state, [kind] if step < until else [])
        sent += list(generator.messages_before(now_ns + STEP_NS))
    return sent


def test_an_event_is_repeated_updated_and_cancelled(car: Callable[..., StationState]) -> None:
    generator = DenmGenerator(DenmRules(repetition_s=0.5), 7, 3_000_000, 65_535)
    sent = drive(car, generator, 40, 11, EventKind.BRAKING)
    assert [round((time_ns - START_NS) / 1e6) for time_ns, _ in sent] == [3, 503, 1003, 1103, 1603, 2103]
    denms = [decode_denm(payload) for _, payload in sent]
    assert {denm.action for denm in denms} == {(7, 65_535)}
    # Detected anew when it moved, and its end once, whose repetitions say the same.
    assert [(denm.detection_ns - START_NS) // 1_000_000 for denm in denms] == [0, 500, 1000, 1100, 1100, 1100]
    assert [denm.termination for denm in denms] == [None] * 3 + [Termination.CANCELLATION] * CANCELLATIONS
    # It has moved more than 4 m after 0.5 and 1 s, and each state is newer than the last.
    assert len({denm.reference_ns for denm in denms}) == 4
    assert denms[0].latitude_deg == 48
    assert denms[-1].reference_ns > denms[2].reference_ns > denms[1].reference_ns
    assert not generator.is_active


def test_the_next_event_has_the_next_number_and_another_station_id_after_a_change(
    car: Callable[..., StationState],
) -> None:
    generator = DenmGenerator(DenmRules(), 7, 0, 65_535)
    drive(car, generator, 20, 2, EventKind.STOPPED)
    again = drive(car, generator, 20, 2, EventKind.STOPPED)
    assert {decode_denm(payload).action for _, payload in again} == {(7, 0)}
    generator.rename(8, 100)
    other = drive(car, generator, 20, 2, EventKind.COLLISION)
    assert {(denm := decode_denm(payload)).action for _, payload in other} == {(8, 100)}
    assert denm.station_id == 8


def test_an_event_that_stays_is_valid_without_a_gap(car: Callable[..., StationState]) -> None:
    rules, sent = DenmRules(validity_s=2, repetition_s=0.5), []
    generator = DenmGenerator(rules, 7, 3_000_000)
    for step in range(100):
        now_ns = START_NS + step * STEP_NS
        generator.update(now_ns, car(time_ns=now_ns), [EventKind.STOPPED])
        sent += list(generator.messages_before(now_ns + STEP_NS))
    denms = [decode_denm(payload) for _, payload in sent]
    assert {denm.action for denm in denms} == {(7, 0)}
    assert len({denm.detection_ns for denm in denms}) == 10
    for (time_ns, _), denm, (next_ns, _) in zip(sent, denms, sent[1:], strict=False):
        assert time_ns < next_ns < denm.detection_ns + denm.validity_s * 1_000_000_000
