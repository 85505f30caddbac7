"""JSON that other parsers would read in silence, or fall over."""

from __future__ import annotations

import json
import time

import pytest

from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json, read_json


def nested(levels: int) -> str:
    return "[" * levels + "]" * levels


def test_what_json_holds_comes_out_as_from_the_standard_library():
    content = {"a": [1, -2, 2.5, True, None, {"b": "ü"}], "c": {"a": {}}}
    for text in (json.dumps(content), json.dumps(content).encode(), b"\xef\xbb\xbf" + json.dumps(content).encode()):
        assert parse_json(text) == content


def test_a_key_that_appears_twice_in_one_object_is_refused_and_in_two_is_not():
    assert parse_json('[{"near": 1}, {"near": 2}]') == [{"near": 1}, {"near": 2}]
    with pytest.raises(ValueError, match=r"^the key 'near' twice in one object$"):
        parse_json('{"frames": [{"near": 1, "far": 3, "near": 2}]}')


def test_a_hundred_levels_are_read_and_one_more_is_refused():
    assert json.dumps(parse_json(nested(100))) == nested(100)
    for levels in (101, 900, 100_000):
        with pytest.raises(ValueError, match=r"^objects or lists nested more than 100 levels deep$"):
            parse_json(nested(levels))


def test_whole_numbers_end_where_floats_do():
    assert float(parse_json("9" * 300)) == pytest.approx(1e300)
    assert parse_json("-" + "9" * 299) == -int("9" * 299)
    beyond = parse_json("1" + "0" * 400)
    assert beyond == 10**400
    assert not isinstance(beyond, int | float)
    assert float(beyond) == float("inf")
    for digits in (1001, 5000, 3_000_000):
        began = time.process_time()
        with pytest.raises(ValueError, match=f"^a whole number of {digits} digits$"):
            parse_json(f'{{"w": {"9" * digits}}}')
        assert time.process_time() - began < 1


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b'{"a": 1, "a": 2}', r"a\.json: expected frames, found the key 'a' twice in one object; write it anew"),
        (b'{"a": }', r"a\.json: expected frames, found Expecting value in line 1, column 7; write it anew"),
        (b'{"a": "\xff"}', r"a\.json: expected frames in UTF-8, found byte 7 that is not; write it anew"),
        (None, r"a\.json: expected frames, found No such file or directory; write it anew"),
    ],
)
def test_a_file_that_cannot_be_used_is_named(content: bytes | None, told: str, tmp_path):
    if content is not None:
        (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(InputError, match=told):
        read_json(tmp_path / "a.json", "frames", "write it anew")
