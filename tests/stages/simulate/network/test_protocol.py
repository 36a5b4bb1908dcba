"""A network of a user's own in a drive: what it sends and who hears it is what the bag holds."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS, VehicleTopics
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate

COARSE = ("sensors.lidars.lidar.channels=1", "sensors.lidars.lidar.points_per_second=1000")


@pytest.fixture(autouse=True)
def in_its_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


def test_a_users_ideal_network_records_a_drive(tmp_path: Path) -> None:
    settings = ["v2x.network=telepathy:Telepathy", "simulation.duration_s=0.5", *COARSE]
    simulate(load_scenario("smoke", [*settings, "vehicles={ego: {}, other: {}}"]), tmp_path / "drive")
    reader = BagReader(tmp_path / "drive" / "clean")
    sent = [message for _, message in reader.messages(V2X_SENT.name)]
    stations = [message.stations for _, message in reader.messages(V2X_STATIONS.name)]
    assert len(sent) == sum(map(len, stations[:-1])) > 100  # no station is known before the first instant
    names = {station.vehicle: station.station_id for each in stations for station in each}
    for vehicle in ("ego", "other"):
        heard = [message for _, message in reader.messages(VehicleTopics(vehicle).received_raw.name)]
        others = [one for one in sent if one.station_id != names[vehicle]]
        assert [one.header.stamp for one in heard] == [one.header.stamp for one in others]
        assert all(bytes(one.data).endswith(b"hello") for one in heard)
    assert VehicleTopics("ego").sent_raw.name in reader.topics
    assert VehicleTopics("ego").received_cam.name not in reader.topics  # bytes that are no CAM
    with pytest.raises(AdvpipeError, match="replayed through the embedded network only"):
        V2xDrive(reader).channel()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("wifi", r"v2x.network 'wifi' is unknown; known: embedded, artery \(or your own module:Class\)"),
        ("telepathy:Nobody", "v2x.network telepathy:Nobody cannot be loaded: AttributeError: "),
        ("nowhere:Nobody", "v2x.network nowhere:Nobody cannot be loaded: ModuleNotFoundError: "),
        ("telepathy:Deaf", "v2x.network telepathy:Deaf is not a network: it lacks "),
        (
            "telepathy:Broken",
            r"telepathy:Broken failed: KeyError: 'antenna' \(telepathy.py, line 7\d\); fix it",
        ),
    ],
)
def test_an_invalid_implementation_is_a_one_line_error(tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        simulate(load_scenario("smoke", [f"v2x.network={name}", *COARSE]), tmp_path / "drive")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "drive").exists()


def test_invalid_implementation_names_are_refused() -> None:
    for name in ("a b", "x:y:z", "../x:Y", "A" * 201, ""):
        with pytest.raises(AdvpipeError, match=r"v2x\.network: String should"):
            load_scenario("smoke", [f"v2x.network={name!r}"])
