"""A report as a notebook shows it: the table of results, and the tables of other families to fold out."""

from __future__ import annotations

from html import escape

from advpipe.pipeline.core.tabular import html_paragraph, html_table
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.section import ReportSection
from advpipe.stages.evaluate.report.table import COLUMNS, clean_lines, lines, lost_of


def notebook_html(report: Report) -> str:
    """The table of all attacks with their baselines, or of the clean clouds where none was attacked; below it
    what other families add, open where it is all there is."""
    parts = [html_paragraph(banner) for banner in report.warnings]
    if any(row.attacked for row in report.results):
        caption = f"Detection; lost: found on the clean cloud and missed, {lost_of(report)}"
        parts.append(html_table(COLUMNS, [line.values() for line in lines(report)], caption))
    elif by_class := clean_lines(report):
        cells = [line.values() for line in by_class]
        parts.append(html_table(list(by_class[0]), cells, "Average precision (R40) on the clean clouds"))
    parts += [_folded(section, is_open=not report.results) for section in report.sections if section.tables]
    if report.folder is not None:
        parts.append(html_paragraph(f"report: {report.folder / 'report.html'}"))
    return "".join(parts)


def _folded(section: ReportSection, is_open: bool) -> str:
    tables = [html_table(each.heads, each.lines, each.title) for each in section.tables if each.lines]
    mark = " open" if is_open else ""
    return f"<details{mark}><summary>{escape(section.title)}</summary>{''.join(tables)}</details>"
