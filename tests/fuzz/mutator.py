"""Damaged bytes from a seed, without knowledge of any format."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable

WORDS = (
    0,
    1,
    2,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0x8000,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    1 << 40,
    (1 << 63) - 1,
    1 << 63,
)
"""Whole numbers at which programs go wrong."""

FLOATS = (0.0, -0.0, 1e-320, 1e-45, 1e38, -1e38, 1e308, float("inf"), float("-inf"), float("nan"))

TOKENS = (
    b"nan", b"inf", b"-inf", b"1e999", b"-1", b"0", b"1e-320", b"9" * 400, b"", b"null", b"true", b"[]", b"{}", b"[" * 200, b'"', b"\0", b"\n",
    b"\r", b"\t", b"\xff\xfe", b"\xef\xbb\xbf", b"../outside/secret.png", b"/dev/zero", b"..", b"%s", b"\\ud800", b"0x10", b"1_000", b"\xd9\xa3",
)  # fmt: skip
"""Pieces of text at which readers of text go wrong; the last is a digit, but none of ASCII."""


def mutated(data: bytes, random: random.Random) -> bytes:
    """The bytes with one to eight changes, mostly few, half of them near the beginning, where headers are."""
    changed = bytearray(data)
    for _ in range(min(8, 1 + int(random.expovariate(0.8)))):
        random.choice(CHANGES)(changed, random)
    return bytes(changed)


def place(data: bytearray, random: random.Random) -> int:
    """An offset in the bytes."""
    limit = len(data) if random.random() < 0.5 else min(len(data), 256)
    return random.randrange(limit + 1)


def flip(data: bytearray, random: random.Random) -> None:
    """Flip a bit."""
    at = place(data, random)
    if at < len(data):
        data[at] ^= 1 << random.randrange(8)


def byte(data: bytearray, random: random.Random) -> None:
    """Set a byte."""
    at = place(data, random)
    data[at : at + 1] = bytes([random.randrange(256)])


def word(data: bytearray, random: random.Random) -> None:
    """Set a whole number of 1 to 8 bytes."""
    at, size = place(data, random), random.choice((1, 2, 4, 8))
    value = (random.choice(WORDS) + random.choice((0, 0, 1, -1))) % (1 << 8 * size)
    data[at : at + size] = value.to_bytes(size, random.choice(("little", "big")))


def real(data: bytearray, random: random.Random) -> None:
    """Set a floating-point number."""
    at, kind = place(data, random), random.choice(("<d", "<f"))
    value = random.choice(FLOATS)
    data[at : at + struct.calcsize(kind)] = struct.pack(kind, value if kind == "<d" or abs(value) < 1e38 else 1e38)


def token(data: bytearray, random: random.Random) -> None:
    """Put some text over other text, or between."""
    at, text = place(data, random), random.choice(TOKENS)
    data[at : at + random.choice((0, 1, len(text)))] = text


def cut(data: bytearray, random: random.Random) -> None:
    """Cut off the end."""
    del data[place(data, random) :]


def remove(data: bytearray, random: random.Random) -> None:
    """Take out a piece."""
    at = place(data, random)
    del data[at : at + 1 + int(random.expovariate(0.05))]


def repeat(data: bytearray, random: random.Random) -> None:
    """Put a piece in twice, somewhere else."""
    at, length = place(data, random), 1 + int(random.expovariate(0.02))
    to = place(data, random)
    data[to:to] = data[at : at + length]


def noise(data: bytearray, random: random.Random) -> None:
    """Put random bytes over others."""
    at, length = place(data, random), 1 + int(random.expovariate(0.05))
    data[at : at + length] = random.randbytes(length)


def digit(data: bytearray, random: random.Random) -> None:
    """Change a digit, a sign or a point of a text."""
    at = place(data, random)
    for offset in range(at, min(len(data), at + 64)):
        if data[offset] in b"0123456789.-":
            data[offset] = random.choice(b"0123456789.-e")
            return


CHANGES: tuple[Callable[[bytearray, random.Random], None], ...] = (
    flip, flip, byte, word, word, real, token, token, cut, remove, repeat, noise, digit, digit,
)  # fmt: skip
