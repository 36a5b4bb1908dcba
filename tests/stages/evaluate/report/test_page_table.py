"""Tables of the page: columns without content are left out, texts stand on the left, heads are explained."""

from advpipe.stages.evaluate.report.page_table import shown_table
from advpipe.stages.evaluate.report.report import FORMULAS
from advpipe.stages.evaluate.report.section import Table

HEADS = ("attack", "baseline", "ratio %", "95 %", "CD m²")


def shown(*lines: tuple[str, ...], note: str = ""):
    return shown_table(Table("title", HEADS, lines, note), FORMULAS)


def test_columns_without_content_are_left_out():
    table = shown(("detach", "near", "4.9", "–", ""), ("", "anywhere", "80.1", "–", "–"))
    assert [head.text for head in table.heads] == ["attack", "baseline", "ratio\u00a0%"]
    assert [cells for _, cells in table.lines] == [("detach", "near", "4.9"), ("", "anywhere", "80.1")]
    assert table.note == ""


def test_a_column_without_any_interval_is_left_out():
    lines = [(name, "near", "4.9", "no interval: 20 frames", "0.1") for name in ("detach", "attach")]
    table = shown(*lines, note="A note.")
    assert [head.text for head in table.heads] == ["attack", "baseline", "ratio\u00a0%", "CD\u00a0m²"]
    assert table.note == "A note."


def test_texts_stand_on_the_left_and_numbers_on_the_right():
    table = shown(("detach", "near", "−1.0", "1…2", "–"), ("attach", "–", "undefined", "1…2", "~0.1"))
    assert [head.is_text for head in table.heads] == [True, True, False, False, False]


def test_heads_name_their_definition():
    table = shown(("detach", "near", "4.9", "1…2", "0.1"))
    assert [head.term for head in table.heads] == ["", "baseline", "map_ratio", "interval", "chamfer"]
    assert table.heads[2].meaning == FORMULAS["map_ratio"]


def test_a_section_s_own_definition_comes_first():
    formulas = {"F1, MCC": "of messages", **FORMULAS}
    table = shown_table(Table("", ("attack", "MCC"), (("cam-dos", "0.5"),)), formulas)
    assert table.heads[1].meaning == "of messages"
