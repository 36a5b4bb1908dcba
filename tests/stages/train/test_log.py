"""Logs that a stopped run goes on with, the picture of them, and the line beside the progress bar."""

from __future__ import annotations

import math

from PIL import Image

from advpipe.pipeline.detector.common.loss import LOSS_PARTS
from advpipe.stages.train.log import VALIDATIONS, Log, plot_training, step_columns
from advpipe.stages.train.status import Status
from advpipe.stages.train.validate import ClassPrecision


def test_rows_from_the_first_step_on_are_replaced(tmp_path):
    path = tmp_path / "validation.csv"
    log = Log(path, VALIDATIONS, 0)
    for step in (1, 2, 3):
        log.add(step, 10.0 * step, 0, 0, math.nan)
    log.close()
    with path.open("a") as file:
        file.write("4,1")  # cut off by a kill
    log = Log(path, VALIDATIONS, 3)  # a kill may come at any moment from now on
    assert path.read_text().splitlines() == [
        "step,car,truck,cyclist,pedestrian",
        "1,10,0,0,nan",
        "2,20,0,0,nan",
    ]
    log.close()


def test_the_picture_has_a_panel_for_validations_if_there_are_any(tmp_path):
    heights = []
    for count in (0, 2):
        steps, validations = (
            Log(tmp_path / "s.csv", step_columns(LOSS_PARTS), 0),
            Log(tmp_path / "v.csv", VALIDATIONS, 0),
        )
        for step in range(5):
            steps.add(step, 0.001, 2.0, 1.0, 0.5, 0.5, 0.0, 3.0)
        for step in range(count):
            validations.add(step, 50, 40, 30, math.nan)
        steps.close(), validations.close()
        plot_training(tmp_path / "s.csv", tmp_path / "v.csv", tmp_path / "p.png")
        heights.append(Image.open(tmp_path / "p.png").height)
    assert heights[1] > heights[0]


def test_the_status_remembers_the_mean_losses_and_the_last_precision():
    status = Status(LOSS_PARTS)
    for box in (0.25, 0.5, 0.75):
        status.step([1.0, box, 0.25, 0.0])
    # Each older step weighs 0.98 of the next one.
    box = (0.25 * 0.98**2 + 0.5 * 0.98 + 0.75) / (0.98**2 + 0.98 + 1)
    assert status.text() == f"loss {1.25 + box:.2f} (score 1 box {box:.2g} direction 0.25)"
    status.precision = {"car": ClassPrecision(9, 71.4, 90.0), "truck": ClassPrecision(0, math.nan, math.nan)}
    assert status.text().endswith("direction 0.25), AP car 71")
