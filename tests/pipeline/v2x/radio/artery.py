"""Replays a recorded run of Artery through advpipe's medium."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow.csv
import pytest

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.medium import Medium
from advpipe.pipeline.v2x.radio.stations import Int64, Outcome, ReceptionOutcomes, Stations, Transmissions
from advpipe.pipeline.v2x.section import Radio

STEP_NS = 100_000_000
ANTENNA_M = 1.5
RADIO = {"sensitivity_dbm": -85.0, "carrier_sense_dbm": -85.0, "snir_threshold_db": 4.0, "noise_dbm": -110.0}
FREE_SPACE = Radio(path_loss="free_space", shadowing=None, fading="none", **RADIO)
NAKAGAMI = Radio(**RADIO)


Columns = dict[str, np.ndarray]


class Trace(NamedTuple):
    """The tables of CAMs and of vehicles' states."""

    folder: Path
    cams: Columns
    states: Columns

    @classmethod
    def recorded(cls) -> Trace:
        folder = Path(os.environ.get("ADVPIPE_ARTERY", ""))
        if not (folder / "base_cams.csv").is_file():
            pytest.skip("ADVPIPE_ARTERY names no folder with a recorded run of Artery")
        return cls(folder, _columns(folder / "base_cams.csv"), _columns(folder / "base_states.csv"))

    def table(self, name: str) -> Columns:
        return _columns(self.folder / name)

    def send_again(self, radio: Radio) -> list[ReceptionOutcomes]:
        """All CAMs through our medium, step by step; messages are numbered by their rows."""
        medium, outcomes = Medium(radio, seed=1), []
        times_ns = np.rint(self.cams["t"] * 1e9).astype(np.int64)
        state_steps = np.rint(self.states["t"] * 10).astype(np.int64)
        for step in range(int(times_ns.min() // STEP_NS), int(times_ns.max() // STEP_NS) + 2):
            rows = np.flatnonzero(times_ns // STEP_NS == step)
            known = state_steps == step - 1  # Artery sends by the step before
            here = {name: column[known] for name, column in self.states.items()}
            antenna_m = np.column_stack([here["x"], here["y"], np.full(known.sum(), ANTENNA_M)])
            stations = Stations(here["k"].astype(np.int64), antenna_m)
            senders = self.cams["k"][rows].astype(np.int64)
            sent = Transmissions(
                messages=rows,
                keys=message_keys(senders, times_ns[rows]),
                senders=senders,
                request_ns=times_ns[rows],
                cam_bytes=self.cams["bytes"][rows].astype(np.int64),
            )
            outcomes.append(medium.advance((step + 1) * STEP_NS, stations, sent).outcomes)
        return outcomes


def by_distance(outcomes: list[ReceptionOutcomes], edges_m: Float64) -> tuple[Int64, Int64]:
    """Pairs of message and receiver, and those received, in each range of distance."""
    pairs, received = (np.zeros(len(edges_m) - 1, np.int64) for _ in range(2))
    for fate in outcomes:
        other = fate.outcome != Outcome.OWN
        pairs += np.histogram(fate.distance_m[other], edges_m)[0]
        received += np.histogram(fate.distance_m[fate.outcome == Outcome.RECEIVED], edges_m)[0]
    return pairs, received


def _columns(path: Path) -> Columns:
    options = pyarrow.csv.ConvertOptions(column_types={"rx_mask": pyarrow.string()})
    table = pyarrow.csv.read_csv(path, convert_options=options)
    return {name: table[name].to_numpy() for name in table.column_names}
