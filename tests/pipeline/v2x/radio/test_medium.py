"""The medium as a whole, on hand-checked and on random drives."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from advpipe.pipeline.v2x.radio import reception
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.medium import Medium, Step
from advpipe.pipeline.v2x.radio.stations import Outcome, Stations, Transmissions
from advpipe.pipeline.v2x.section import Radio

PLAIN = Radio(path_loss="free_space", shadowing=None, fading="none")
MS = 1_000_000


def on_a_road(*places_m: float) -> Stations:
    """Stations 10, 11, ... along the x axis."""
    antenna_m = np.column_stack([places_m, np.zeros(len(places_m)), np.full(len(places_m), 1.5)])
    return Stations(np.arange(10, 10 + len(places_m)), antenna_m)


def sending(senders: list[int], at_ms: list[float], cam_bytes: int = 41) -> Transmissions:
    times_ns = np.round(np.array(at_ms) * MS).astype(np.int64)
    ids = np.array(senders, np.int64)
    lengths = np.full(len(ids), cam_bytes)
    return Transmissions(np.arange(len(ids)), message_keys(ids, times_ns), ids, times_ns, lengths)


def outcomes(radio: Radio, stations: Stations, sent: Transmissions, until_ms: int = 100) -> np.ndarray:
    """Outcomes (messages, stations), in the order of the messages."""
    outcomes = Medium(radio, seed=1).advance(until_ms * MS, stations, sent).outcomes
    return outcomes.outcome[np.argsort(outcomes.messages)]


def test_noise_limits_reception_in_free_space() -> None:
    """6 dB over -98 dBm are -92 dBm: 2276 m; QPSK 1/2 goes from all to nothing within about 2 dB."""
    (fate,) = outcomes(PLAIN, on_a_road(0, 1000, 1950, 2700), sending([10], [5]))
    assert fate.tolist() == [Outcome.OWN, Outcome.RECEIVED, Outcome.RECEIVED, Outcome.NOISE]
    deaf = PLAIN.model_copy(update={"sensitivity_dbm": -85.0})
    (fate,) = outcomes(deaf, on_a_road(0, 1000, 1030), sending([10], [5]))
    assert fate.tolist() == [Outcome.OWN, Outcome.RECEIVED, Outcome.WEAK]


def test_arrival_is_after_air_time_and_propagation() -> None:
    medium = Medium(PLAIN, seed=1)
    outcomes = medium.advance(100 * MS, on_a_road(0, 299.792458), sending([10], [5])).outcomes
    (reception,) = outcomes.receptions()
    assert reception.arrival_ns == 5 * MS + 208_000 + 1000
    assert (reception.message, reception.receiver) == (0, 11)
    assert reception.power_dbm == pytest.approx(23 - 47.86 - 20 * np.log10(299.792458), abs=0.01)


def test_processing_delays_are_within_their_bounds() -> None:
    slow = PLAIN.model_copy(update={"processing_delay_min_s": 0.001, "processing_delay_max_s": 0.002})
    outcomes = (
        Medium(slow, seed=1).advance(100 * MS, on_a_road(0, *range(1, 200)), sending([10], [5])).outcomes
    )
    delay_ms = np.array([r.arrival_ns for r in outcomes.receptions()]) / MS - 5.208
    assert len(delay_ms) == 199
    assert 1.0 <= delay_ms.min() < 1.02
    assert 1.98 < delay_ms.max() <= 2.001


def test_a_sender_receives_nothing_and_equal_signals_collide() -> None:
    """Both start simultaneously; in the middle they are equally strong, near one of them it is captured."""
    fate = outcomes(PLAIN, on_a_road(0, 400, 200, 20), sending([10, 11], [5, 5]))
    assert fate[0].tolist() == [Outcome.OWN, Outcome.SENDING, Outcome.INTERFERENCE, Outcome.RECEIVED]
    assert fate[1].tolist() == [Outcome.SENDING, Outcome.OWN, Outcome.INTERFERENCE, Outcome.INTERFERENCE]


def test_a_later_message_captures_only_with_6_db() -> None:
    """The senders, 1200 m apart, do not hear each other; the second starts while the first is on the air."""
    sent = sending([10, 11], [5, 5.1])
    fate = outcomes(PLAIN, on_a_road(0, 1200, 600, 1100, 100), sent)
    assert fate[1, 2:].tolist() == [Outcome.BUSY, Outcome.RECEIVED, Outcome.BUSY]
    assert fate[0, 2:].tolist() == [Outcome.INTERFERENCE, Outcome.INTERFERENCE, Outcome.RECEIVED]
    alone = PLAIN.model_copy(update={"interference": False})
    assert (outcomes(alone, on_a_road(0, 1200, 600, 1100, 100), sent)[:, 2:] == Outcome.RECEIVED).all()


def test_neighbours_do_not_send_simultaneously() -> None:
    fate = outcomes(PLAIN, on_a_road(0, 400, 200), sending([10, 11], [5, 5.1]))
    assert fate.tolist() == [
        [Outcome.OWN, Outcome.RECEIVED, Outcome.RECEIVED],
        [Outcome.RECEIVED, Outcome.OWN, Outcome.RECEIVED],
    ]


def test_the_busy_ratio_equals_one_computed_by_hand() -> None:
    """Ten messages of 208 us in 100 ms; the far station hears those of the near one only."""
    stations = on_a_road(0, 500, 1400)
    at_ms = [1, 11, 21, 31, 41, 51, 61, 71, 81, 99.9]
    step = Medium(PLAIN, seed=1).advance(100 * MS, stations, sending([10, 11] * 5, at_ms))
    (load,) = step.loads
    assert load.end_ns == 100 * MS
    last_ms = 0.1  # of the last message falls into the next window
    np.testing.assert_allclose(load.busy_ratio[:2], (9 * 0.208 + last_ms) / 100)
    np.testing.assert_allclose(load.busy_ratio[2], (4 * 0.208 + last_ms) / 100)


def random_drive(messages: int = 400, stations: int = 40) -> tuple[Stations, Transmissions]:
    rng = np.random.default_rng(1)
    at_ms = np.sort(rng.uniform(0, 300, messages))
    sent = sending((10 + rng.integers(0, stations, messages)).tolist(), at_ms.tolist(), cam_bytes=300)
    return on_a_road(*rng.uniform(0, 1500, stations)), sent


def subset(sent: Transmissions, rows: np.ndarray) -> Transmissions:
    columns = (sent.messages, sent.keys, sent.senders, sent.request_ns, sent.cam_bytes)
    return Transmissions(*(column[rows] for column in columns))


def in_steps(radio: Radio, stations: Stations, sent: Transmissions, ends_ms: list[int]) -> list[Step]:
    medium, begin_ns, steps = Medium(radio, seed=1), 0, []
    for end_ms in ends_ms:
        rows = (sent.request_ns >= begin_ns) & (sent.request_ns < end_ms * MS)
        steps.append(medium.advance(end_ms * MS, stations, subset(sent, rows)))
        begin_ns = end_ms * MS
    return steps


def test_the_division_into_steps_changes_nothing() -> None:
    stations, sent = random_drive()
    whole = in_steps(Radio(), stations, sent, [400])
    cut = in_steps(Radio(), stations, sent, [*range(3, 301, 9), 310, 400])
    for name in ("messages", "start_ns", "outcome", "power_dbm", "sinr_db", "end_ns", "delay_ns"):
        parts = [getattr(step.outcomes, name) for step in cut]
        np.testing.assert_array_equal(np.concatenate(parts), getattr(whole[0].outcomes, name), err_msg=name)
    loads = [load for step in cut for load in step.loads]
    assert [load.end_ns for load in loads] == [load.end_ns for load in whole[0].loads]
    for one, other in zip(loads, whole[0].loads, strict=True):
        np.testing.assert_array_equal(one.busy_ratio, other.busy_ratio)
    assert len(set(whole[0].outcomes.outcome.ravel().tolist())) == 7  # everything occurs


@pytest.mark.parametrize("cells", [1, 40 * 7, 40 * 1000])
def test_the_division_into_blocks_changes_nothing(cells: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not the last bit: the borders lie between the pairs of one message, too."""
    stations, sent = random_drive()
    (whole,) = in_steps(Radio(), stations, sent, [400])
    monkeypatch.setattr(reception, "BLOCK_CELLS", cells)
    (cut,) = in_steps(Radio(), stations, sent, [400])
    for name in ("outcome", "sinr_db", "end_ns", "delay_ns"):
        assert getattr(cut.outcomes, name).tobytes() == getattr(whole.outcomes, name).tobytes(), name


def test_overlapping_messages_take_no_memory_of_their_own() -> None:
    """300 stations that do not hear each other send at once: 89,700 pairs, whose powers would take 215 MB."""
    stations = on_a_road(*np.linspace(0, 3e5, 300))
    sent = sending([*range(10, 310)], [1.0] * 300, cam_bytes=300)
    medium = Medium(PLAIN, seed=1)
    tracemalloc.start()
    try:
        found = medium.advance(100 * MS, stations, sent).outcomes
        _, most_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert found.outcome.shape == (300, 300)
    assert most_bytes < 40e6


def test_an_unchanged_message_has_the_same_outcome() -> None:
    """Half of the messages are removed, which delays no other message: all other outcomes stay the same."""
    stations, sent = random_drive()
    alone = Radio(interference=False, carrier_sense_dbm=-30)
    all_outcomes = Medium(alone, seed=1).advance(400 * MS, stations, sent).outcomes
    kept = sent.senders % 2 == 0  # all or none of a station's, as it can only send one at a time
    outcomes = Medium(alone, seed=1).advance(400 * MS, stations, subset(sent, kept)).outcomes
    rows = np.isin(all_outcomes.messages, outcomes.messages)
    is_sending = all_outcomes.outcome[rows] == Outcome.SENDING
    np.testing.assert_array_equal(all_outcomes.outcome[rows][~is_sending], outcomes.outcome[~is_sending])
    np.testing.assert_array_equal(all_outcomes.power_dbm[rows], outcomes.power_dbm)
    assert 0 < rows.mean() < 1


def test_another_seed_gives_other_outcomes() -> None:
    stations, sent = random_drive()
    one, other = (Medium(Radio(), seed=s).advance(400 * MS, stations, sent).outcomes.outcome for s in (1, 2))
    assert 0.05 < (one != other).mean() < 0.5


def test_stations_may_appear_and_leave() -> None:
    medium = Medium(PLAIN, seed=1)
    two = on_a_road(0, 100)
    sent = sending([10, 11, 11], [99.9, 99.95, 99.97])
    first = medium.advance(100 * MS, two, sent)
    assert len(first.outcomes.messages) == 0  # on the air at the end of the step
    later = Stations(np.array([12, 10]), np.array([[50.0, 0, 1.5], [1, 0, 1.5]]))  # 11 has gone, 12 is new
    outcomes = medium.advance(200 * MS, later, Transmissions.none()).outcomes
    assert outcomes.messages.tolist() == [0]
    assert outcomes.outcome.tolist() == [[Outcome.WEAK, Outcome.OWN]]  # 12 came when it was under way
    assert sorted(outcomes.dropped.tolist()) == [1, 2]


def test_no_stations_and_no_messages_are_accepted() -> None:
    empty = Stations(np.empty(0, np.int64), np.empty((0, 3)))
    medium = Medium(Radio(), seed=1)
    for end_ms in (100, 200):
        step = medium.advance(end_ms * MS, empty, Transmissions.none())
        assert step.outcomes.outcome.shape == (0, 0)
    assert step.loads[0].busy_ratio.shape == (0,)


@pytest.mark.parametrize(
    ("until_ms", "sent", "message"),
    [
        (200, sending([10], [250]), "not all between"),
        (200, sending([10], [50]), "not all between"),
        (50, Transmissions.none(), "has advanced to 100000000 ns already"),
        (200, sending([99], [150]), "station 99 sends but is not on the road"),
    ],
)
def test_inconsistent_transmissions_are_refused(until_ms: int, sent: Transmissions, message: str) -> None:
    medium = Medium(Radio(), seed=1)
    medium.advance(100 * MS, on_a_road(0, 10), Transmissions.none())
    with pytest.raises(ValueError, match=message):
        medium.advance(until_ms * MS, on_a_road(0, 10), sent)


def test_stations_are_checked() -> None:
    with pytest.raises(ValueError, match="same id"):
        Stations(np.array([1, 1]), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="finite"):
        Stations(np.array([1]), np.full((1, 3), np.nan))
