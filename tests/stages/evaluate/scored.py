"""How these tests evaluate: in this process, since starting another takes longer than their bags."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.run import Report
from advpipe.stages.evaluate.run import evaluate as evaluate_anywhere


def evaluate(
    clean: Path,
    adversarial: Sequence[Path],
    out: Path,
    *,
    detector: str | Sequence[str],
    defences: Sequence[str] = (),
    baseline_tries: int | None = 1,
    workers: int = 1,
    overwrite: bool = False,
    **options: Any,
) -> Report:
    detectors = (detector,) if isinstance(detector, str) else tuple(detector)
    asked = Options(detectors=detectors, defences=tuple(defences), baseline_tries=baseline_tries, **options)
    return evaluate_anywhere(clean, adversarial, out, asked, workers=workers, overwrite=overwrite)


def document(out: Path) -> dict[str, Any]:
    """The report's figures."""
    found: dict[str, Any] = json.loads((out / "report.json").read_text())
    return found


def unwrapped(capsys: Any) -> str:
    """What was printed, without the terminal's line ends."""
    return " ".join(capsys.readouterr().out.split())
