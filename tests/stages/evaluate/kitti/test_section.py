"""A simulated drive as KITTI has it, imported again, by KITTI's own rules."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.dataset.sample import copy_sample
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.image_labels.label_camera import LabelCamera
from advpipe.pipeline.metrics.kitti import kitti_precisions
from advpipe.stages.evaluate.kitti.objects import detected_objects, labelled_objects
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.run import evaluate
from advpipe.stages.export.run import export_bags
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import import_drive


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kitti")
    copy_sample(folder / "sample", overwrite=False)
    export_bags(folder / "sample", "kitti", folder / "exported")
    source = folder / "exported" / "clean"
    return import_drive(ImportRequest("kitti", source, ImportOptions()), folder / "imported").bag


def test_true_boxes_as_detections_are_where_the_labels_say(imported: Path) -> None:
    camera, seen = LabelCamera(imported, None), 0
    for frame in read_frames(imported):
        view = camera.at(frame.stamp_ns)
        truth = labelled_objects(frame, view)
        boxes = frame.boxes
        scores = np.ones(len(boxes))
        found = detected_objects(Detections(boxes.geometry, scores, boxes.labels), view)
        counted = [
            k for k, name in enumerate(truth.names) if name in ("Car", "Truck", "Cyclist", "Pedestrian")
        ]
        assert [truth.names[k] for k in counted] == list(found.names)
        assert np.allclose(truth.boxes[counted], found.boxes, atol=1e-6)
        # the labels' edges are rounded to .01 px, and boxes to .01 m, which is some pixels on a near object
        assert np.abs(truth.bbox_px[counted] - found.bbox_px).max(initial=0) < 5
        perfect = kitti_precisions([truth], [found])
        for each in perfect:
            if each.objects and each.space == "3d":
                # KITTI reads precision at as many recall positions as there are objects
                assert each.r40 == pytest.approx((each.objects - 1) / 40)
        seen += len(counted)
    assert seen == 3


def test_a_report_has_the_rules_only_for_a_drive_with_labels_of_images(
    imported: Path, tmp_path: Path
) -> None:
    options = Options(baseline=False, scene=False, bootstrap_draws=10)
    report = evaluate(imported, [], tmp_path / "report", options, workers=1)
    rows = report.to_dicts("kitti")
    assert {row["condition"] for row in rows} == {"clean"}
    assert len(rows) == 3 * 3 * 4 * 2  # classes, difficulties, spaces with aos, sets of overlaps
    assert "own rules" in (tmp_path / "report" / "report.html").read_text()
    assert LabelCamera(copy_sample(tmp_path / "sample", overwrite=False), None).is_virtual
