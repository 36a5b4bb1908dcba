"""Logs of beacons, written from the published lists of keys: no original data set was at hand."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

STEP_S, STEPS = 0.5, 24
HONEST, LIAR, EAR = 7, 13, 21
"""Two senders, and the vehicle that receives."""
OFFSET_M = 60.0
FALSE_FROM = 8


def _place(station: int, step: int) -> tuple[float, float]:
    """Cars in lanes of their own, eastwards at 10 m/s."""
    return 5000.123456789 + 10.0 * STEP_S * step, 5800.25 + 4.0 * station


def _claimed(station: int, step: int) -> tuple[float, float]:
    x_m, y_m = _place(station, step)
    return (x_m, y_m + OFFSET_M) if station == LIAR and step >= FALSE_FROM else (x_m, y_m)


def _vectors(place: tuple[float, float], noise_m: float) -> dict[str, Any]:
    return {
        "pos": [*place, 0.0],
        "pos_noise": [noise_m, noise_m, 0.0],
        "spd": [10.0, 0.0, 0.0],
        "spd_noise": [0.0012345678901234567, 0.0, 0.0],
        "acl": [0.0, 0.0, 0.0],
        "acl_noise": [1e-05, 0.0, 0.0],
        "hed": [1.0, 0.0, 0.0],
        "hed_noise": [2.5, 2.5, 0.0],
    }


def _lines(records: list[dict[str, Any]]) -> str:
    return "".join(json.dumps(each) + "\n" for each in records)


def write_f2md(folder: Path) -> Path:
    """As VeReMi Extension: pseudonyms, vectors of all quantities, the attack in the names of files alone."""
    folder.mkdir(parents=True)
    truth, heard, number = [], [], 0
    for step in range(STEPS):
        time_s = 25_200.0 + STEP_S * step
        heard.append({"type": 2, "rcvTime": time_s, **_vectors(_place(EAR, step), 1.0)})
        for station in (HONEST, LIAR):
            number += 1
            sent_s = time_s + 0.001 * station
            about = {"sender": station, "senderPseudo": 10 * station, "messageID": number}
            claimed = _vectors(_claimed(station, step), 3.0)
            heard.append({"type": 3, "rcvTime": sent_s + 0.0001, "sendTime": sent_s, **about, **claimed})
            truth.append({"type": 4, "sendTime": sent_s, **about, **_vectors(_place(station, step), 0.0)})
    (folder / f"traceJSON-{EAR}-19-A0-25200-7.json").write_text(_lines(heard))
    (folder / f"traceJSON-{LIAR}-11-A13-25200-7.json").write_text("")
    (folder / f"traceJSON-{HONEST}-5-A0-25200-7.json").write_text("")
    (folder / "traceGroundTruthJSON-7.json").write_text(_lines(truth))
    return folder


def write_veremi(folder: Path) -> Path:
    """As VeReMi (2018): no headings; attackerType in the ground truth."""
    folder.mkdir(parents=True)
    truth, heard, number = [], [], 0
    for step in range(STEPS):
        time_s = 10_800.0 + STEP_S * step
        own = {"pos": [*_place(EAR, step), 1.895], "noise": [0, 0, 0], "spd": [10.0, 0.0, 0]}
        heard.append({"type": 2, "rcvTime": time_s, **own, "spd_noise": [0, 0, 0]})
        for station in (HONEST, LIAR):
            number += 1
            sent_s = time_s + 0.001 * station
            body = {"pos": [*_claimed(station, step), 1.895], "pos_noise": [0, 0, 0], "spd": [10.0, 0.0, 0.0]}
            about = {"sender": station, "messageID": number}
            heard.append(
                {
                    **{"type": 3, "rcvTime": sent_s + 0.0001, "sendTime": sent_s},
                    **{**about, **body, "spd_noise": [0, 0, 0], "RSSI": 1.25e-07},
                }
            )
            is_false = station == LIAR and step >= FALSE_FROM
            about |= {"attackerType": 2 if is_false else 0}
            truth.append({"type": 4, "time": sent_s, **about, **body, "spd_noise": [0, 0, 0]})
    (folder / f"JSONlog-0-{EAR}-A0.json").write_text(_lines(heard))
    (folder / "GroundTruthJSONlog.json").write_text(_lines(truth))
    return folder


def write_nextgen(folder: Path, *, as_texts: bool = False) -> Path:
    """As VeReMi NextGen: lists with headings in degrees, aliases beyond 32 bits and a label each.

    as_texts: every number as the simulation writes it, before attacks are added.
    """
    folder.mkdir(parents=True)
    heard, number = [], 0
    for step in range(STEPS):
        for station in (HONEST, LIAR):
            number += 1
            sent_ns = 7_200_000_000_000 + round(STEP_S * step * 1e9) + station
            heard.append(
                {
                    "rcvTime": sent_ns + 400_000,
                    "sendTime": sent_ns,
                    "sender_id": f"veh_{station}",
                    "sender_alias": 5_000_000_000 + station,
                    "messageID": number,
                    "attacker": int(station == LIAR and step >= FALSE_FROM),
                    "receiver": _numbers(_place(EAR, step)),
                    "sender": _numbers(_claimed(station, step)) | {"distance_to_road_edge": 1.75},
                }
            )
    if as_texts:
        heard = [_texts(each) for each in heard]
    (folder / f"veh_{EAR}.json").write_text(json.dumps(heard, indent=4))
    return folder


def _numbers(place: tuple[float, float]) -> dict[str, Any]:
    return {
        "pos": f"{place[0]},{place[1]},0.0",
        "pos_noise": "-1.25,0.5,0.0",
        "spd": 10.0,
        "spd_noise": -0.00016,
        "acl": 0.1 + 0.2,
        "acl_noise": 0.0,
        "hed": 90.0,
        "hed_noise": math.degrees(0.1),
        "driversProfile": "NORMAL",
    }


def _texts(values: dict[str, Any]) -> dict[str, Any]:
    return {key: _texts(each) if isinstance(each, dict) else str(each) for key, each in values.items()}


WRITERS = {"veremi": write_veremi, "f2md": write_f2md, "nextgen": write_nextgen}
