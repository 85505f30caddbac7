"""Files of weights that are damaged, or were made to mislead: each is refused in one line, at once."""

from __future__ import annotations

import hashlib
import json
import struct
import time
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save_file

from semgs.files.errors import InputError
from semgs.files.tensor_files import open_tensors
from semgs.model import networks
from semgs.model.weights.header import CHECKSUM
from semgs.model.weights.load import find, load, shipped
from semgs.model.weights.weights_file import checksum, is_ours, read_header, read_tensors, restate


def stored(path: Path, tensors: dict[str, torch.Tensor], **header: str) -> Path:
    """A small file of weights whose settings are those of `small`."""
    given = {"semgs": "2", "settings": json.dumps(networks.small().as_json()), "classes": "null"}
    save_file(tensors, path, given | header)
    return path


def bare(path: Path, header: bytes, body: bytes = b"") -> Path:
    """A safetensors file of any header."""
    path.write_bytes(struct.pack("<Q", len(header)) + header + body)
    return path


def with_setting(*keys: str, value: object) -> str:
    """The settings of `small` as JSON with one of them changed."""
    settings = json.loads(json.dumps(networks.small().as_json()))
    part = settings
    for key in keys[:-1]:
        part = part[key]
    part[keys[-1]] = value
    return json.dumps(settings)


def test_the_checksum_is_of_name_type_shape_and_bytes():
    tensors = {"b": torch.tensor([1, 2], dtype=torch.uint8), "a": torch.zeros(1, 1, dtype=torch.bfloat16)}
    by_hand = b"a torch.bfloat16 [1, 1]\n\0\0" + b"b torch.uint8 [2]\n\1\2"
    assert checksum(tensors) == hashlib.sha256(by_hand).hexdigest()


def test_one_flipped_bit_of_a_tensor_is_noticed_and_files_without_a_checksum_load(tmp_path):
    tensors = {"a": torch.arange(6.0).reshape(2, 3)}
    path = stored(tmp_path / "a", tensors, **{CHECKSUM: checksum(tensors)})
    torch.testing.assert_close(read_tensors(path), tensors, rtol=0, atol=0)
    assert CHECKSUM not in read_header(path).metadata
    data = bytearray(path.read_bytes())
    data[-3] ^= 1
    path.write_bytes(data)
    with pytest.raises(
        InputError, match=r"tensors_sha256: expected tensors with sha256 \w{12}.* found \w{12}; the file"
    ):
        read_tensors(path)
    with pytest.raises(InputError, match="damaged"):
        restate(path, tmp_path / "again", {"licence": "CC0"})
    assert not (tmp_path / "again").exists()
    older = stored(tmp_path / "older", load_file(path))
    assert read_tensors(older)["a"].shape == (2, 3)
    restate(older, older, {"licence": "CC0"})
    with open_tensors(older, "weights") as file:
        assert file.metadata()[CHECKSUM] == checksum(load_file(path))


def test_the_weights_that_ship_are_older_than_checksums_and_load():
    assert read_header(shipped("small")).settings.name == "small"
    assert len(read_tensors(shipped("small"))) > 100


@pytest.mark.parametrize(
    ("keys", "value", "told"),
    [
        (
            ("colour", "transformer", "camera_aware"),
            "no",
            r"colour\.transformer\.camera_aware: expected bool, found 'no'",
        ),
        (("colour", "from_image"), 0, r"colour\.from_image: expected bool, found 0"),
        (("semantic", "own_cnn"), None, r"semantic\.own_cnn: expected bool, found None"),
        (("channels",), 48.0, r"channels: expected int, found 48\.0"),
        (("channels",), True, "channels: expected int, found True"),
        (("channels",), 4097, r"channels: expected a whole number in 0\.\.4096, found 4097"),
        (("cnn_widths",), [16, 32], r"cnn_widths: Not enough values in \[16, 32\]"),
        (("cnn_widths",), [16, 32, "48"], r"cnn_widths\[2\]: expected int, found '48'"),
        (
            ("colour", "depth", "initial_scale"),
            float("nan"),
            r"colour\.depth\.initial_scale: expected a finite number, found nan",
        ),
        (("conventions", "z_depth"), "false", r"conventions\.z_depth: expected bool, found 'false'"),
        (("conventions", "candidates"), "log", "conventions.candidates: expected inverse or linear"),
        (("colour", "heads"), 3, "expected settings and a class table"),
    ],
)
def test_a_setting_of_another_type_is_named(keys, value, told, tmp_path):
    path = stored(tmp_path / "a", {"a": torch.zeros(1)}, settings=with_setting(*keys, value=value))
    with pytest.raises(InputError, match=told):
        read_header(path)


@pytest.mark.parametrize(
    "keys", [("channels",), ("colour", "transformer", "reduction"), ("colour", "depth", "width"), ("last_kernel",)]
)
def test_a_network_far_larger_than_its_file_is_not_built(keys, tmp_path):
    path = stored(tmp_path / "a", {"a": torch.zeros(1)}, settings=with_setting(*keys, value=4096))
    began = time.process_time()
    with pytest.raises(InputError, match="settings of its network, found"):
        load("small", path)
    assert time.process_time() - began < 5


def test_a_long_header_is_refused_before_it_is_parsed(tmp_path):
    row = b'"t%07d":{"dtype":"F32","shape":[0],"data_offsets":[0,0]},'
    long = (
        b"{"
        + b"".join(row % number for number in range(150_000))
        + b'"a":{"dtype":"F32","shape":[0],"data_offsets":[0,0]}}'
    )
    path = bare(tmp_path / "a", long)
    began = time.process_time()
    with pytest.raises(InputError, match=f"a header of {len(long):,} bytes; at most 8,388,608 are read"):
        read_tensors(path)
    assert not is_ours(path)
    assert find(path) == ("mvsplat", path)
    assert time.process_time() - began < 0.5


@pytest.mark.parametrize(
    ("header", "told"),
    [
        (b'{"__metadata__":{"semgs":"1","semgs":"2"}}', "the key 'semgs' twice"),
        (b'{"a":{"dtype":"U8","shape":[0],"data_offsets":[0,0]},"a":{"dtype":"U8","shape":[0],"data_offsets":[0,0]}}', "twice"),
        (b'{"__metadata__":' + b'{"a":' * 100_000, "weights"),
        (b'{"__metadata__":{"semgs":"2","settings":"' + b"[" * 5000 + b'","classes":"null"}}', "nested more than 100|Expecting"),
        (b'{"__metadata__":{"semgs":"2","settings":"' + b"9" * 5000 + b'","classes":"null"}}', "a whole number of 5000 digits"),
        (b'{"__metadata__":{"semgs":"2","settings":"[]","classes":"null"}}', "settings and a class table as JSON"),
    ],
)  # fmt: skip
def test_a_crafted_header_is_refused(header, told, tmp_path):
    with pytest.raises(InputError, match=told) as caught:
        read_header(bare(tmp_path / "a", header))
    assert "\n" not in str(caught.value)
