"""The command that shows a new user what advpipe does, within seconds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from advpipe.pipeline.cli.shared import Answer, Overwrite, typed
from advpipe.pipeline.core.progress import plan_progress, with_progress, working_on
from advpipe.pipeline.core.text import counted

EPS_M = 0.5
POINTS = 300
ROUNDS = 5
"""Half of those of `attach`, for less waiting; random-best judges as many tries."""


@with_progress("attacking and evaluating a sample")
def demo(
    out: Annotated[Path, typer.Option("--out", "-o", help="Data set folder.")] = Path("advpipe-demo"),
    browser: Annotated[bool, typer.Option(help="Open the shipped report in the browser.")] = True,
    overwrite: Overwrite = False,
) -> Answer:
    """Show a shipped report at once, and beside it attack three shipped LiDAR clouds and evaluate.

    Works offline and in an empty folder. What it makes is a data set for the other commands.
    """
    from advpipe.pipeline.core.errors import OutputExistsError
    from advpipe.pipeline.core.verbosity import notice
    from advpipe.pipeline.dataset.sample import copy_sample, shipped_report
    from advpipe.pipeline.process.browser import open_page

    if out.exists() and not overwrite:
        raise OutputExistsError(out)
    page = shipped_report()
    is_open = browser and open_page(page)
    notice(f"a report made earlier{' is in your browser' if is_open else ''}: {page}")
    notice(f"now adding {POINTS} points to each of three clouds, into {out}: some 30 s")
    with working_on("loading libraries"):  # a second or two, in which the page is there already
        from advpipe.commands.attack import attack
        from advpipe.commands.evaluate import evaluate
    plan_progress({"attacking": 1, "evaluating": 1})
    clean = copy_sample(out, overwrite=overwrite)
    with working_on("attacking"):
        attacked = attack(
            clean, type="attach", eps_m=EPS_M, points=POINTS, rounds=ROUNDS, workers=1, overwrite=overwrite
        )
    with working_on("evaluating"):
        report = evaluate(clean, attacked, defence="none", workers=1, overwrite=overwrite)
    assert report.folder is not None  # it has been written
    made, document = report.folder / "report.html", json.loads(report.to_json())

    return Answer(
        {"data_set": out, "shipped_report": page, "report": made, **document},
        lambda: _show_table(document["rows"][0], report.results[0].strongest_baseline),
        made={"report": made},
        next_commands=[typed("attack", out, "--type", "detach"), typed("evaluate", out, "--overwrite")],
    )


def _show_table(row: Mapping[str, Any], baseline: str | None) -> None:
    """Mean average precision before and after, and under random-best with the same budget."""
    from advpipe.stages.evaluate.detection.baseline import baseline_title

    lines = [
        ("clean", row["map_clean"], 100.0),
        (f"{POINTS} points added, chosen", row["map_adv"], row["map_ratio_percent"]),
    ]
    if baseline:
        title = f"{POINTS} added, {baseline_title(baseline, row['baseline_tries'])}"
        lines.append((title, row[f"{baseline}_map_adv"], row[f"{baseline}_map_ratio_percent"]))
    about = f"{counted(row['frames'], 'cloud')}, {counted(row['objects'], 'object')}"
    print(f"{about:<42}{'mAP':>6}{'of clean':>12}")
    for title, precision, percent in lines:
        print(f"{title:<42}{precision:>6.3f}{percent:>10.0f} %")
    print()
