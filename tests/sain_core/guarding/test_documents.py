"""Documents beyond the limits, or that are none, are refused in one line."""

import json

import pytest

from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.guarding.documents import (
    DEPTH,
    DIGITS,
    YAML_BYTES,
    dump_yaml,
    parse_json,
    parse_yaml,
    read_user_yaml,
)

DEEP = "[" * (DEPTH + 1) + "]" * (DEPTH + 1)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (DEEP, "more than 64 deep"),
        ('{"a":' * 100_000, "more than 64 deep"),
        ("9" * 400, "the number 9{100} is too large for a double"),
        ("[" + "1," * 4_000_000 + "1]", "more than 4,000,000 values"),
        ('["\\ud800"]', "half a character"),
        ("{", "Expecting property name"),
        ('[{"b": {"a": 1, "b": 1, "a": 2}}]', "the key 'a' is given twice"),
    ],
)
def test_json_is_refused(text, reason):
    with pytest.raises(UntrustedFileError, match=reason):
        parse_json(text)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (DEEP, "more than 64 deep"),
        ("\n".join(" " * n + "a:" for n in range(80)), "more than 64 deep"),
        ("9" * (DIGITS + 1), "101 digits"),
        ("0x" + "f" * 200, "202 digits"),
        ("a: &a [1]\nb: *a", "anchor"),
        ("a: &a 1", "anchor"),
        ("!!python/object:os.system x", "tag"),
        ("- a\n" * 200_000, "more than 200,000 values"),
        ("a" * (YAML_BYTES + 1), "bytes"),
        ("a: 2001-99-99", "a value cannot be read"),
        ("a: 1\nb:\n  c: 1\n  d: 2\n  c: 3", "line 5: the key 'c' is given twice; remove one"),
        ("- {a: 1, b: 2, 'a': 1}", "line 1: the key 'a' is given twice"),
        ("1: a\n1.0: b", "line 2: the key 1.0 is given twice"),
        ("a:\n\t- 1", "^line 2, column 1: .*; indent with spaces, no tabs$"),
        ("a: b: c", "^line 1, column 5: mapping values are not allowed in this context$"),
        ("a: 1\n---\na: 2", "line 2, column 1: expected a single document"),
        ("{a: b}: c", "unhashable"),
    ],
)
def test_yaml_is_refused(text, reason):
    with pytest.raises(UntrustedFileError, match=reason):
        parse_yaml(text)


def test_what_is_within_the_limits_is_read():
    content = {"depth": json.loads("[" * 60 + "]" * 60), "digits": 10**90, "text": "x" * 5000}
    assert parse_json(json.dumps(content)) == content
    assert parse_yaml(json.dumps(content)) == content
    assert parse_yaml(f'a: ! "b"\nc: {"x" * 500}') == {"a": "b", "c": "x" * 500}
    assert parse_json("\ufeff[1]") == parse_yaml("\ufeff[1]") == [1]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e0", 1.0), ("8e-2", 0.08), ("-3E+2", -300.0), (".5", 0.5), ("2.", 2.0), ("010", 10),
        ("-089", -89), ("0x1F", 31), ("+1", 1), ("-.inf", float("-inf")), ("12:30", "12:30"),
        ("1_000", "1_000"), ("0.1 m", "0.1 m"), ("1e", "1e"), (".", "."), ("'1e0'", "1e0"),
    ],
)  # fmt: skip
def test_numbers_are_those_of_yaml_1_2(text, value):
    read = parse_yaml(f"a: {text}")["a"]
    assert (type(read), read) == (type(value), value)


def test_what_is_dumped_is_read_as_it_was():
    texts = ["1e0", "7e12", "010", "1:30", ".5", "yes", "1_0", "+1", "0x1f", "2020-01-01", ""]
    content = {"texts": texts, "numbers": [1.0, 1e-7, 1e22, 3, float("inf")], "b": None, "a": True}
    assert parse_yaml(dump_yaml(content)) == content
    assert list(parse_yaml(dump_yaml(content))) == list(content)


@pytest.mark.parametrize("version", ["%YAML:1.0", "%YAML 1.0", "%YAML 1.2"])
def test_a_matrix_of_opencv_is_read(version):
    text = f"{version}\n---\na: !!opencv-matrix\n   rows: 1\n   data: [ 1., 2.5e+02 ]\n"
    assert parse_yaml(text)["a"] == {"rows": 1, "data": [1.0, 250.0]}


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"", "is not read: it is empty; it must have keys and values"),
        (b"- 1\n- 2\n", r"is not read: it has \[1, 2\]; it must have keys and values"),
        (b"a: 1\nb: \xe4\n", "is not read: it is not UTF-8: line 2 has the byte 0xe4"),
        (b"\xff\xfe", "is not read: it is not UTF-8, but UTF-16"),
        (b"<robot/>", "is not read: it is XML .a URDF goes under the key `urdf` of a robot file"),
        (None, "No such file or directory; try another one"),
    ],
)
def test_a_file_of_a_user_is_refused_in_one_line(tmp_path, content, text):
    path = tmp_path / "mine.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError, match=f"^settings {path}.*{text}") as refused:
        read_user_yaml(path, "settings", "; try another one")
    assert "\n" not in str(refused.value)
