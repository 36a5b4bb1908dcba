"""Large arrays of records, one at a time."""

import json
from pathlib import Path

import pytest

from advpipe.pipeline.core import json_array
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.json_array import read_json_array


def written(folder: Path, text: str) -> Path:
    file = folder / "table.json"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize("chunk", [1, 2, 7, 1 << 20])
@pytest.mark.parametrize("indent", [None, 0, 2])
def test_records_may_lie_across_chunks(tmp_path, monkeypatch, chunk, indent):
    monkeypatch.setattr(json_array, "_CHUNK", chunk)
    records = [{"token": "é]}" * k, "list": [k, {"a": [-1.5e3]}], "no": None} for k in range(5)]
    file = written(tmp_path, json.dumps(records, indent=indent, ensure_ascii=False))
    assert list(read_json_array(file, "a table?")) == records
    assert list(read_json_array(file, "a table?", lambda record: record["list"][0] == 3)) == [records[3]]


@pytest.mark.parametrize("text", ["[]", " \n[ ]\n", "\ufeff[]"])
def test_an_array_may_be_empty(tmp_path, text):
    assert list(read_json_array(written(tmp_path, text), "a table?")) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "does not begin with"),
        ('{"a": 1}', "does not begin with"),
        ("[1]", "holds 1 in place of a record"),
        ('[{"a": 1}', "truncated"),
        ('[{"a": "b', "truncated"),
        ('[{"a" 1}, {"a": 1}]', "not valid JSON"),
        ('[{"a": NaN}]', "NaN is not a JSON number"),
        ('[{"a": 1, "a": 2}]', "a key is given twice"),
        ('[{"a": "\\u0000"}]', "NUL"),
        ('[{"a": ' + "9" * 200 + "}]", "a number has 200 characters"),
        ('[{"a": ' + "9" * 9000 + "}]", "not valid JSON"),
        ('[{"a": ' + "[" * 200 + "]" * 200 + "}]", "nested"),
        ('[{"a": ' + "[" * 200_000 + "]" * 200_000 + "}]", "nested"),
        ('[{"a": "' + "b" * (3 << 20) + '"}]', "2097152 characters"),
        ("[" + '{"a": "' + "b" * (5 << 20), "a record of more than 2097152 characters"),
    ],
)
def test_what_is_no_array_of_records_is_one_line(tmp_path, text, message):
    with pytest.raises(AdvpipeError, match=message) as caught:
        list(read_json_array(written(tmp_path, text), "a table?"))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_files_that_are_no_text_are_named(tmp_path):
    (tmp_path / "table.json").write_bytes(b'[{"a": "\xff"}]')
    with pytest.raises(AdvpipeError, match="not a UTF-8 text file"):
        list(read_json_array(tmp_path / "table.json", "a table?"))
    with pytest.raises(AdvpipeError, match="cannot be read"):
        list(read_json_array(tmp_path / "gone.json", "a table?"))
