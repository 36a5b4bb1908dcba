"""Route files of the user's: driven as written, and refused in one line where they are wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.stages.simulate.traffic.road_users import RoadUser

Driver = Callable[[Scenario, int], list[dict[str, RoadUser]]]
ROUTES = """<routes>
  <vType id="lorry" vClass="truck" length="8"/> <vType id="bike" vClass="bicycle" length="1.6"/>
  <route id="r" edges="ab bc"/>
  <vehicle id="one" type="lorry" route="r" depart="0"/>
  <vehicle id="two" type="bike" depart="3" departSpeed="max"><route edges="ab bc"/></vehicle>
  <trip id="three" type="sedan.1" from="ab" to="bc" depart="6"/>
</routes>"""


def scenario(folder: Path, net: Path, text: str, *settings: str) -> Scenario:
    (folder / "own.rou.xml").write_text(text)
    more = [f"map.sumo_net={net}", "simulation.warmup_s=8", f"traffic.routes={folder / 'own.rou.xml'}"]
    return load_scenario("smoke", [*more, *settings])


def test_user_vehicles_drive_their_routes_with_our_bodies(
    tmp_path: Path, road: Callable[..., Path], drive: Driver
) -> None:
    state = drive(scenario(tmp_path, road(600), ROUTES), 1)[-1]
    assert set(state) == {"ego", "one", "two", "three"}
    assert {name: user.variant.body.label for name, user in state.items()} == {
        "ego": "car",
        "one": "truck",
        "two": "cyclist",
        "three": "car",
    }
    assert abs(state["one"].variant.length_m - 8) < 1.5
    assert state["three"].variant.name == "sedan.1"


def test_a_configuration_names_routes_and_types(
    tmp_path: Path, road: Callable[..., Path], drive: Driver
) -> None:
    """Types in an additional file, and a begin: who departs at 100 s is there 8 s later."""
    types, rest = ROUTES.split("<route id", 1)
    (tmp_path / "t.add.xml").write_text(types.replace("<routes>", "<additional>") + "</additional>")
    rest = rest.replace('depart="', 'depart="10')  # 100, 103, 106
    (tmp_path / "own.rou.xml").write_text("<routes><route id" + rest)
    (tmp_path / "own.sumocfg").write_text(
        '<configuration><input><net-file value="elsewhere.net.xml"/><route-files value="own.rou.xml"/>'
        '<additional-files value="t.add.xml"/></input><time><begin value="100"/></time></configuration>'
    )
    settings = [f"map.sumo_net={road(600)}", "simulation.warmup_s=8"]
    settings.append(f"traffic.sumo_config={tmp_path / 'own.sumocfg'}")
    state = drive(load_scenario("smoke", settings), 1)[-1]
    assert set(state) == {"ego", "one", "two", "three"}


BAD = {
    '<route id="r" edges="ab bd"/>': r"route 'r': no edge 'bd' on this network; the nearest name is",
    '<route id="r" edges="ab nb"/>': r"route 'r': edge 'ab' does not lead to 'nb'; it leads to bc",
    '<route id="r" edges=""/>': r"route 'r': the route is empty",
    '<trip id="t" from="ab" to="x" depart="0"/>': r"trip 't': no edge 'x'",
    '<vType id="t" vClass="tram"/>': r"vType 't' has vClass 'tram', for which there is no body",
    '<vehicle id="v" type="x" depart="0"><route edges="ab"/></vehicle>': r"no vType 'x' is defined",
    '<vehicle id="ego" depart="0"><route edges="ab"/></vehicle>': r"'ego' has the name of an instrumented",
    '<vehicle id="parked.3" depart="0"><route edges="ab"/></vehicle>': r"'parked.3' has a reserved name",
    '<flow id="pedestrian" begin="0" end="9" number="3" from="ab" to="bc"/>': r"has a reserved name",
    '<person id="p" depart="0"><walk edges="ab"/></person>': r"person 'p': only vehicles are supported",
    '<vehicle id="v" route="none" depart="0"/>': r"traffic\.routes: SUMO rejects it: .*none",
    '<vehicle id="v" depart="soon"><route edges="ab"/></vehicle>': r"traffic\.routes: SUMO rejects it",
    '<vehicle id="v">': r"own\.rou\.xml is not a SUMO route file .* or is truncated",
}


@pytest.mark.parametrize(("text", "message"), BAD.items(), ids=range(len(BAD)))
def test_invalid_routes_are_one_line_errors(
    tmp_path: Path, road: Callable[..., Path], drive: Driver, text: str, message: str
) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        drive(scenario(tmp_path, road(200), f"<routes>{text}</routes>"), 1)
    assert "\n" not in str(caught.value)


def test_missing_files_are_one_line_errors(tmp_path: Path, road: Callable[..., Path], drive: Driver) -> None:
    net = road(200)
    with pytest.raises(AdvpipeError, match=r"traffic\.routes: .*gone\.rou\.xml does not exist"):
        drive(scenario(tmp_path, net, ROUTES, f"traffic.routes={tmp_path / 'gone.rou.xml'}"), 1)
    config = tmp_path / "own.sumocfg"
    settings = [f"map.sumo_net={net}", f"traffic.sumo_config={config}"]
    config.write_text("<configuration><input/></configuration>")
    with pytest.raises(AdvpipeError, match=r"own\.sumocfg names no route-files"):
        drive(load_scenario("smoke", settings), 1)
    config.write_text('<configuration><input><route-files value="no.rou.xml"/></input></configuration>')
    with pytest.raises(AdvpipeError, match=r"traffic\.sumo_config: .*no\.rou\.xml does not exist"):
        drive(load_scenario("smoke", settings), 1)


@pytest.mark.parametrize("taken", ["one", "f.2"])
def test_a_name_in_both_routes_and_trajectories_is_refused(
    tmp_path: Path, road: Callable[..., Path], drive: Driver, taken: str
) -> None:
    table = tmp_path / "poses.csv"
    table.write_text(f"id,time_s,x_m,y_m,z_m,yaw_rad\n{taken},0,50,0,0,0\n{taken},9,90,0,0,0\n")
    flow = '<flow id="f" begin="0" end="9" number="3" from="ab" to="bc"/></routes>'
    text = ROUTES.replace("</routes>", flow)
    with pytest.raises(AdvpipeError, match=r"has the name of one in trajectories\.file"):
        drive(scenario(tmp_path, road(300), text, f"trajectories={{file: {table}}}"), 1)


LAUGHS = (
    "<!DOCTYPE routes ["
    + '<!ENTITY a0 "ha">'
    + "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10))
    + "]><routes>&a9;</routes>"
)
BOMBS = {
    '<routes><flow id="f" begin="0" end="9" number="1000000000" from="ab" to="bc"/></routes>': (
        r"traffic\.routes: 1,000,000,000 vehicles would depart during the drive; at most 100,000"
    ),
    '<routes><flow id="f" begin="0" period="0.00001" from="ab" to="bc"/></routes>': "vehicles would depart",
    '<routes><include href="own.rou.xml"/></routes>': r"one of more than 100 files, or includes itself",
    '<routes><include href="gone.rou.xml"/></routes>': r"gone\.rou\.xml does not exist",
    LAUGHS: r"own\.rou\.xml declares a document type \(<!DOCTYPE>\)",
    f"<routes>{'<a>' * 200}{'</a>' * 200}</routes>": "is nested too deeply: more than 100 levels",
}


@pytest.mark.parametrize(("text", "message"), BOMBS.items(), ids=range(len(BOMBS)))
def test_xml_bombs_are_refused_before_sumo_reads_them(
    tmp_path: Path,
    road: Callable[..., Path],
    drive: Driver,
    monkeypatch: pytest.MonkeyPatch,
    text: str,
    message: str,
) -> None:
    monkeypatch.setattr(
        "advpipe.stages.simulate.traffic.sumo.user_traffic._load_in_sumo",
        lambda *_: pytest.fail("SUMO read it"),
    )
    with pytest.raises(AdvpipeError, match=message):
        drive(scenario(tmp_path, road(200), text), 1)


def test_included_route_files_are_counted_and_checked(
    tmp_path: Path, road: Callable[..., Path], drive: Driver
) -> None:
    (tmp_path / "more.rou.xml").write_text(ROUTES.replace('"three"', '"four"'))
    text = '<routes><include href="more.rou.xml"/><trip id="three" from="bc" to="bc" depart="1"/></routes>'
    state = drive(scenario(tmp_path, road(600), text), 1)[-1]
    assert {"one", "two", "three", "four"} <= set(state)
    (tmp_path / "more.rou.xml").write_text('<routes><flow id="f" end="9" number="1e9" from="ab"/></routes>')
    with pytest.raises(AdvpipeError, match="1,000,000,001 vehicles would depart"):
        drive(scenario(tmp_path, road(600), text), 1)


@pytest.mark.parametrize("begin", ["-1", "nan", "1e300", "soon", "x" * 100_000])
def test_an_invalid_begin_is_refused(
    tmp_path: Path, road: Callable[..., Path], drive: Driver, begin: str
) -> None:
    (tmp_path / "own.rou.xml").write_text(ROUTES)
    config = tmp_path / "own.sumocfg"
    config.write_text(
        '<configuration><input><route-files value="own.rou.xml"/></input>'
        f'<time><begin value="{begin}"/></time></configuration>'
    )
    settings = [f"map.sumo_net={road(200)}", f"traffic.sumo_config={config}"]
    with pytest.raises(AdvpipeError, match=r"begin '.{1,110} is not in seconds"):
        drive(load_scenario("smoke", settings), 1)


def test_a_network_with_entities_is_refused(tmp_path: Path, road: Callable[..., Path], drive: Driver) -> None:
    net = tmp_path / "a.net.xml"
    net.write_text(LAUGHS.replace("routes", "net"))
    with pytest.raises(AdvpipeError, match=r"map\.sumo_net: .*a\.net\.xml declares a document type"):
        drive(load_scenario("smoke", [f"map.sumo_net={net}"]), 1)


def test_more_vehicles_than_fit_on_the_lanes_are_refused(
    tmp_path: Path, road: Callable[..., Path], drive: Driver
) -> None:
    settings = [f"map.sumo_net={road(200)}", "traffic.vehicles=5000"]
    with pytest.raises(AdvpipeError, match=r"traffic\.vehicles is 5000; the .* km of lanes"):
        drive(load_scenario("smoke", settings), 1)


ROUTES_OF_EGO = {
    "[ab, xx]": r"vehicles\.ego\.route: no edge 'xx' on this network; the nearest name is",
    "[nb, ab]": r"vehicles\.ego\.route: edge 'nb' does not lead to 'ab'; it leads to bc",
    "[]": r"vehicles\.ego\.route: the route is empty",
}


@pytest.mark.parametrize(("route", "message"), ROUTES_OF_EGO.items())
@pytest.mark.parametrize("driver", ["traffic", "controller"])
def test_invalid_routes_of_instrumented_vehicles_are_one_line_errors(
    road: Callable[..., Path], drive: Driver, route: str, message: str, driver: str
) -> None:
    settings = [f"map.sumo_net={road(200)}", f"vehicles={{ego: {{route: {route}, driver: {driver}}}}}"]
    with pytest.raises(AdvpipeError, match=message):
        drive(load_scenario("smoke", settings), 1)


def test_an_instrumented_vehicle_keeps_its_route_and_speed(road: Callable[..., Path], drive: Driver) -> None:
    """At 6 m/s it is some 200 m farther after 34 s, and it stops at the end of its route."""
    settings = [f"map.sumo_net={road(300)}", "vehicles={ego: {route: [ab, bc], speed_mps: 6}}"]
    settings += ["traffic.vehicles=0", "simulation.warmup_s=1"]
    states = drive(load_scenario("smoke", settings), 900)
    speeds = [float((state["ego"].velocity_mps ** 2).sum() ** 0.5) for state in states]
    assert max(speeds) == pytest.approx(6, abs=0.7)
    assert states[-1]["ego"].position_m[0] > 480
    assert speeds[-1] < 0.1
