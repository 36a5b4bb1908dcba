"""Tables of a grid's attacks on messages and fixes: means over drives, with intervals over drives."""

from __future__ import annotations

from collections.abc import Sequence

from advpipe.pipeline.campaigns.grid.messages import LOCALISATION, V2X
from advpipe.pipeline.campaigns.grid.models import GridFile
from advpipe.pipeline.campaigns.grid.statistics import GridGroup
from advpipe.stages.evaluate.report.numbers import with_interval
from advpipe.stages.evaluate.report.section import Table

COLUMNS = {
    LOCALISATION: {
        "position_rmse_clean_m": "RMSE clean, m",
        "position_rmse_adv_m": "RMSE attacked, m",
        "fixes_detected_percent": "fixes detected %",
        "off_course_percent": "more than 5 m off, % of the time",
    },
    V2X: {
        "misbehaviour_f1": "F1 of misbehaviour detection",
        "ldm_error_clean_m": "LDM error clean, m",
        "ldm_error_adv_m": "LDM error attacked, m",
        "false_ldm_entries": "false LDM entries",
        "honest_delivered_clean_percent": "honest messages received, clean %",
        "honest_delivered_percent": "attacked %",
        "false_warnings": "false warnings",
    },
}
"""By what the stratum begins with: the columns of `GridValues` that are shown, and their heads."""

_TITLES = {LOCALISATION: "Position estimates over drives", V2X: "V2X over drives"}


def message_tables(grid: GridFile, groups: Sequence[GridGroup]) -> list[Table]:
    """A table for each family that was attacked: a line for each level, attack and vehicle."""
    tables = []
    for kind, columns in COLUMNS.items():
        lines = []
        for group in groups:
            levels, attack, _, _ = group.key
            for stratum in group.strata:
                if not stratum.startswith(kind):
                    continue
                means = [group.mean(stratum, column) for column in columns]
                figures = [with_interval(mean.value, mean.ci95) for mean in means]
                drives = str(max(mean.drives for mean in means))
                lines.append((*map(str, levels), attack, stratum.removeprefix(kind), drives, *figures))
        if lines:
            heads = (*grid.factors, "attack", "vehicle", "drives", *columns.values())
            tables.append(Table(_TITLES[kind], heads, tuple(lines)))
    return tables
