"""Files that are well formed and say something odd, by Hypothesis: values, keys, names and lengths, format by format."""

from __future__ import annotations

import gzip
import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import PurePosixPath
from typing import Any

from hypothesis import strategies as st

from fuzz.mutator import FLOATS, TOKENS, WORDS

Draw = Callable[[st.SearchStrategy[Any]], Any]

PATHS = (
    "../outside/secret.png", "/dev/zero", "/dev/stdin", "..", ".", "", "/", "images", "\0", "a" * 5000, "C:\\x.png", "\ud800.png", "~/x", "a/../../b.png",
    "x\n\x1b[31m.png", "-rf", "con", "images/000.png/", "./" * 3000,
)  # fmt: skip
"""Names of files that lead elsewhere, or nowhere."""

NUMBERS = st.one_of(
    st.sampled_from((0, 1, -1, 2, 255, 256, 65536, 10**9, 2**31, 2**63, -(2**63), 10**30, 10**310, *FLOATS)),
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.floats(-10, 10),
)
TEXTS = st.one_of(st.sampled_from(PATHS), st.text(max_size=12))
LEAVES = st.one_of(NUMBERS, TEXTS, st.none(), st.booleans())
VALUES = st.one_of(LEAVES, st.lists(LEAVES, max_size=5), st.dictionaries(st.text(max_size=5), LEAVES, max_size=3))
SMALL = st.sampled_from((*WORDS, 3, 4, 5, 7, 8, 16, 17, 64, 1000, 65535))


def edited(name: str, data: bytes, draw: Draw) -> bytes:
    """The content of a file with one to three edits that suit its kind."""
    edit = EDITS.get(PurePosixPath(name).suffix.lower() or name, fields)
    for _ in range(draw(st.integers(1, 3))):
        try:
            data = edit(data, draw)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError, struct.error, zipfile.BadZipFile):
            data = fields(data, draw)  # an edit before it has made it something else
    return data


def json_values(data: bytes, draw: Draw) -> bytes:
    """JSON with another value, without a key, or with a value elsewhere."""
    tree = [json.loads(data)]
    places: list[tuple[Any, Any]] = []
    level: list[Any] = [tree]
    while level and len(places) < 5000:
        inside = [
            (one, key)
            for one in level
            for key in (one if isinstance(one, dict) else range(len(one) if len(one) < 64 else 8))
        ]
        places += inside
        level = [one[key] for one, key in inside if isinstance(one[key], dict | list)]
    holder, key = places[draw(st.integers(0, len(places) - 1))]
    how = draw(st.sampled_from(("value", "value", "value", "remove", "wrap", "other", "empty", "many")))
    if how == "value":
        holder[key] = draw(VALUES)
    elif how == "remove" and holder is not tree:
        del holder[key]
    elif how == "wrap":
        holder[key] = [holder[key]]
    elif how == "other":
        holder[key] = json.loads(json.dumps(places[draw(st.integers(0, len(places) - 1))][0]))
    elif how == "empty":
        holder[key] = type(holder[key])() if holder[key] is not None else {}
    elif how == "many" and isinstance(holder, list):
        holder.insert(0, holder[key])
    return json.dumps(tree[0]).encode()


def text_tokens(data: bytes, draw: Draw) -> bytes:
    """Text with another token, or without one, or with lines in another order."""
    lines = re.split(rb"(?<=\n)", data)
    at = draw(st.integers(0, len(lines) - 1))
    how = draw(st.sampled_from(("token", "token", "token", "remove", "twice", "swap", "join", "empty")))
    if how == "token":
        found = list(re.finditer(rb"[^\s,=]+", lines[at]))
        if found:
            one = found[draw(st.integers(0, len(found) - 1))]
            new = draw(
                st.one_of(st.sampled_from(TOKENS), NUMBERS.map(lambda value: repr(value).encode()), TEXTS.map(_bytes))
            )
            lines[at] = lines[at][: one.start()] + new + lines[at][one.end() :]
    elif how == "remove":
        del lines[at]
    elif how == "twice":
        lines.insert(at, lines[at])
    elif how == "swap":
        lines[0], lines[at] = lines[at], lines[0]
    elif how == "join":
        lines[at] = lines[at].rstrip()
    else:
        lines[at] = b"\n"
    return b"".join(lines)


def fields(data: bytes, draw: Draw) -> bytes:
    """Bytes with another number at an offset of the header or elsewhere."""
    size = draw(st.sampled_from((1, 2, 4, 8)))
    at = draw(st.one_of(st.integers(0, 400), st.integers(0, max(0, len(data) - 1)))) // size * size
    value = draw(st.one_of(SMALL.map(lambda number: number % (1 << 8 * size)), st.integers(0, (1 << 8 * size) - 1)))
    number = value.to_bytes(size, "little")
    if size >= 4 and draw(st.booleans()):
        number = struct.pack("<d" if size == 8 else "<f", draw(st.floats(width=32)))
    return data[:at] + number + data[at + size :]


def png_chunks(data: bytes, draw: Draw) -> bytes:
    """A PNG with another chunk, whose checksum is right."""
    chunks, at = [], 8
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 12 + length
    if not chunks:
        return fields(data, draw)
    place = draw(st.integers(0, len(chunks) - 1))
    kind, held = chunks[place]
    how = draw(st.sampled_from(("fields", "fields", "kind", "remove", "twice", "pixels")))
    if how == "fields":
        chunks[place] = (kind, fields(held, draw))
    elif how == "kind":
        chunks[place] = (
            draw(
                st.sampled_from(
                    (b"PLTE", b"tRNS", b"acTL", b"fdAT", b"eXIf", b"iCCP", b"zTXt", b"IDAT", b"IEND", b"xxxx")
                )
            ),
            held,
        )
    elif how == "remove":
        del chunks[place]
    elif how == "twice":
        chunks.insert(place, (kind, held))
    else:
        packed = zlib.compress(draw(st.binary(max_size=64)) * draw(st.sampled_from((0, 1, 1000))))
        chunks = [(one, packed if one == b"IDAT" else rest) for one, rest in chunks]
    return data[:8] + b"".join(
        struct.pack(">I", len(held)) + kind + held + struct.pack(">I", zlib.crc32(kind + held)) for kind, held in chunks
    )


def zip_members(data: bytes, draw: Draw) -> bytes:
    """A zip archive with a member that is edited, renamed, added, missing, twice, or a link."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(one.filename, archive.read(one)) for one in archive.infolist()]
    place = draw(st.integers(0, len(members) - 1))
    name, held = members[place]
    how = draw(st.sampled_from(("edit", "edit", "edit", "rename", "remove", "add", "link")))
    mode = 0o644
    if how == "edit":
        members[place] = (name, EDITS.get(PurePosixPath(name).suffix or name, fields)(held, draw) if held else b"x")
    elif how == "rename":
        members[place] = (draw(TEXTS) or "x", held)
    elif how == "remove":
        del members[place]
    elif how == "add":
        members.append((draw(TEXTS) or "x", held))
    else:
        members[place], mode = (name, b"../outside/secret.png"), 0o120777
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for number, (one, content) in enumerate(members):
            info = zipfile.ZipInfo(one.encode("utf-8", "replace").decode())
            info.external_attr = (mode if number == place else 0o644) << 16
            if info.filename not in archive.namelist():
                archive.writestr(info, content, draw(st.sampled_from((0, 8))) if number == place else 0)
    return file.getvalue()


def safetensors_header(data: bytes, draw: Draw) -> bytes:
    """A safetensors file with another header, whose length is right; texts in it that are JSON are edited too."""
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    said = header.get("__metadata__", {})
    nested = [key for key, value in said.items() if value[:1] in ("{", "[")]
    if nested and draw(st.booleans()):
        key = draw(st.sampled_from(nested))
        said[key] = json_values(said[key].encode(), draw).decode()
        text = json.dumps(header).encode()
    else:
        text = json_values(json.dumps(header).encode(), draw)
    return len(text).to_bytes(8, "little") + text + data[8 + length :]


def head_tokens(end: bytes) -> Callable[[bytes, Draw], bytes]:
    """Edits the tokens of the text in front of some bytes, and sometimes a number behind."""

    def edit(data: bytes, draw: Draw) -> bytes:
        head, mark, body = data.partition(end)
        if draw(st.integers(0, 3)) == 0 and body:
            return head + mark + fields(body, draw)
        return text_tokens(head, draw) + mark + body

    return edit


def spz_blocks(data: bytes, draw: Draw) -> bytes:
    """An SPZ file with other numbers in its blocks or its header, packed again."""
    if data[:2] != b"\x1f\x8b":
        return fields(data, draw)
    return gzip.compress(fields(gzip.decompress(data), draw), mtime=0)


def glb_json(data: bytes, draw: Draw) -> bytes:
    """A binary glTF with another JSON, whose lengths are right, or other numbers in its buffer."""
    length = int.from_bytes(data[12:16], "little")
    text, rest = data[20 : 20 + length], data[20 + length :]
    if draw(st.integers(0, 3)) == 0:
        rest = rest[:8] + fields(rest[8:], draw)
    else:
        text = json_values(text, draw)
        text += b" " * (-len(text) % 4)
    total = 20 + len(text) + len(rest)
    return data[:8] + total.to_bytes(4, "little") + len(text).to_bytes(4, "little") + b"JSON" + text + rest


def npy_header(data: bytes, draw: Draw) -> bytes:
    """An array file with another header, whose length is right."""
    if data[:6] != b"\x93NUMPY":
        return fields(data, draw)
    length = int.from_bytes(data[8:10], "little")
    head = data[10 : 10 + length]
    found = list(re.finditer(rb"[\w<>|.]+|[(){},:']", head))
    one = found[draw(st.integers(0, len(found) - 1))]
    kinds = st.sampled_from(
        (
            b"(",
            b")",
            b"'",
            b"|O",
            b"<f8",
            b"V8",
            b"<U9",
            b"<c16",
            b"True",
            b"-1",
            b"9" * 18,
            b"(" * 300,
            b"1e9",
            b"'a':1,",
        )
    )
    head = head[: one.start()] + draw(kinds) + head[one.end() :]
    return data[:8] + len(head).to_bytes(2, "little") + head + data[10 + length :]


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


EDITS: dict[str, Callable[[bytes, Draw], bytes]] = {
    **dict.fromkeys((".json", ".gltf", "metadata"), json_values),
    ".spz": spz_blocks,
    ".glb": glb_json,
    **dict.fromkeys((".txt", ".tsv", ".log", ".jsonl", ".yaml", ".csv"), text_tokens),
    **dict.fromkeys((".zip", ".r3d", ".npz"), zip_members),
    ".png": png_chunks,
    ".pgm": head_tokens(b"\n255"),
    ".safetensors": safetensors_header,
    ".ply": head_tokens(b"end_header\n"),
    ".npy": npy_header,
}
"""How files of a kind are edited; all others are numbers one behind the other."""
