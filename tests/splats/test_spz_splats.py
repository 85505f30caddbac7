"""SPZ of versions 2 to 4, from bytes that are worked out by hand."""

from __future__ import annotations

import builtins
import gzip
import struct
from math import exp, sqrt
from pathlib import Path

import pytest
import torch
from splat_files import save, spz, spz_blocks
from traced_memory import most_memory

from semgs.files.errors import InputError
from semgs.geometry.gaussians import Appearance, Gaussians, move_gaussians
from semgs.splats.load import load_splat
from semgs.splats.spz import HARMONICS_FLIP

RECORD = struct.Struct("<II")
VERSIONS = (2, 3, 4)


@pytest.fixture(autouse=True)
def zstd() -> None:
    """The library for version 4."""
    pytest.importorskip("zstandard")


def read(tmp_path: Path, data: bytes) -> Gaussians:
    return load_splat(save(tmp_path / "a.spz", data)).gaussians


@pytest.mark.parametrize("version", VERSIONS)
def test_blocks_are_unpacked_and_come_with_y_down_and_z_forward(tmp_path: Path, version: int):
    splat = load_splat(save(tmp_path / "a.spz", spz(version, spz_blocks(version))))
    gaussians, shape = splat.gaussians, splat.gaussians.colour
    assert (splat.format, splat.up, splat.comments) == ("SPZ", "-y", (f"SPZ version {version}",))
    assert gaussians.means.tolist() == [[1, -2, 3], [0, 0, 0]]
    assert gaussians.opacities.tolist() == pytest.approx([0.2, 1])
    assert shape.features[:, 0].tolist() == [
        pytest.approx([0.5 / 0.15, -0.5 / 0.15, -0.3 / 0.15]),
        pytest.approx([-0.5 / 0.15] * 3),
    ]
    assert shape.scales.tolist() == [pytest.approx([1, exp(1), exp(-1)]), pytest.approx([exp(-10)] * 3)]
    # The file has (0.5, -0.5, 0) and (0, 0.5, -0.5) for y and z, which change their sign, and (-0.5, 0, 0.5) for x.
    assert shape.features[0, 1:].tolist() == [[-0.5, 0.5, 0], [0, -0.5, 0.5], [-0.5, 0, 0.5]]


def test_version_2_has_bytes_for_x_y_z_and_w_follows(tmp_path: Path):
    quaternions = read(tmp_path, spz(2, spz_blocks(2))).colour.quaternions
    assert quaternions[0].tolist() == pytest.approx([sqrt(1 - 0.36 - 0.36 - 0.04), 0.6, 0.6, -0.2], abs=1e-6)
    least = 1 / 255  # between the steps of a byte
    length = sqrt(1 + 2 * least**2)  # x is -1, so that nothing is left for w
    assert quaternions[1].tolist() == pytest.approx([0, -1 / length, least / length, -least / length], abs=1e-6)


@pytest.mark.parametrize("version", [3, 4])
def test_later_versions_have_the_smallest_three(tmp_path: Path, version: int):
    first, second = read(tmp_path, spz(version, spz_blocks(version))).colour.quaternions.tolist()
    y = 255 / 511 / sqrt(2)
    assert first == pytest.approx([sqrt(0.5 - y * y), sqrt(0.5), y, 0], abs=1e-6)
    assert second == pytest.approx([-sqrt(0.5), 0, -sqrt(0.5), 0], abs=1e-6)


def test_harmonics_are_those_of_the_scene_after_half_a_turn_about_x():
    turn = torch.diag(torch.tensor([1.0, -1, -1, 1], dtype=torch.float64))
    features = torch.randn(3, 16, 3, generator=torch.Generator().manual_seed(1))
    shape = Appearance(torch.eye(4)[:1].repeat(3, 1), torch.ones(3, 3), features)
    moved = move_gaussians(turn, Gaussians(torch.zeros(3, 3), torch.ones(3), shape)).colour.features
    torch.testing.assert_close(
        moved[:, 1:], features[:, 1:] * torch.from_numpy(HARMONICS_FLIP)[:, None], rtol=1e-4, atol=1e-5
    )


@pytest.mark.parametrize("version", VERSIONS)
def test_degree_0_has_no_harmonics_and_extensions_that_change_nothing_are_skipped(tmp_path: Path, version: int):
    records = RECORD.pack(0xADBE0002, 12) + bytes(12) + RECORD.pack(0xADBE0003, 4) + struct.pack("<I", 4)
    splat = load_splat(
        save(tmp_path / "a.spz", spz(version, spz_blocks(version, 0), degree=0, flags=3, extensions=records))
    )
    assert splat.gaussians.colour.features.shape == (2, 1, 3)
    assert "antialiasing" in splat.comments[1]


def spoiled(version: int, **options: object) -> bytes:
    return spz(version, spz_blocks(version), **options)  # type: ignore[arg-type]


OTHER_AXES = RECORD.pack(0xADBE0003, 4) + struct.pack("<I", 6)
BAD = {
    "cut off": (spoiled(3)[:-9], "more, or a stream that is cut off"),
    "cut off inside": (spoiled(3)[:40], "fewer"),
    "more": (spz(3, [*spz_blocks(3), b"\0"]), "the end after 2 Gaussians"),
    "more behind": (spoiled(3) + b"x", "the end after 2 Gaussians"),
    "few blocks": (spz(2, spz_blocks(2)[:-1]), "fewer"),
    "many Gaussians": (spoiled(3, count=4_000_000), "fewer"),
    "too many": (spoiled(4, count=2**32 - 1), "1 to 50,000,000 Gaussians, found 4,294,967,295"),
    "none": (spz(3, [], count=0), "found 0"),
    "degree 4": (spoiled(3, degree=4), "harmonics of degree 0 to 3, found degree 4"),
    "bits": (spoiled(3, bits=24), "at most 23 fractional bits"),
    "flags": (spoiled(3, flags=0x80), "flags that are known"),
    "other axes": (spoiled(3, flags=2, extensions=OTHER_AXES), "axes right, up, back"),
    "other axes of version 4": (spoiled(4, flags=2, extensions=OTHER_AXES), "axes right, up, back"),
    "extension cut off": (spoiled(3, flags=2, extensions=OTHER_AXES[:-1]), "one that is cut off"),
    "extensions without flag": (spoiled(4, extensions=OTHER_AXES), "the table of contents behind the header"),
    "gzip of something": (gzip.compress(b"hello"), "another kind of file"),
    "gzip of version 4": (gzip.compress(struct.pack("<4sIIBBBB", b"NGSP", 4, 1, 0, 12, 0, 0)), "SPZ of version 2 or 3, found version 4"),
    "gzip of version 1": (gzip.compress(struct.pack("<4sIIBBBB", b"NGSP", 1, 1, 0, 12, 0, 0)), "SPZ of version 2 or 3 or 4, found version 1"),
    "version 5": (spoiled(4).replace(b"NGSP\4", b"NGSP\5", 1), "SPZ of version 2 or 3 or 4, found version 5"),
    "header only": (b"NGSP\4", "inside the header"),
    "longer than its streams": (spoiled(4) + b"x", "the end after the last stream"),
    "shorter than its streams": (spoiled(4)[:-1], "streams inside the file"),
    "one stream less": (spz(4, spz_blocks(4)[:-1]), "6 streams, found 5"),
    "no zstd": (spoiled(4).replace(b"\x28\xb5\x2f\xfd", b"abcd"), "a zstd stream"),
    "smaller stream": (spz(4, [spz_blocks(4)[0][:-1], *spz_blocks(4)[1:]]), "of the sizes of its Gaussians"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_what_is_damaged_or_not_known_is_refused_in_one_line(tmp_path: Path, what: str):
    data, message = BAD[what]
    with pytest.raises(InputError) as error:
        read(tmp_path, data)
    assert message in str(error.value)
    assert str(tmp_path / "a.spz") in str(error.value)


def test_a_bomb_is_not_inflated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Two Gaussians, and then 300 MB of zeros."""
    head = gzip.decompress(spoiled(3))
    data = gzip.compress(head + bytes(300_000_000), compresslevel=1)
    assert len(data) < 2_000_000

    def inflate() -> None:
        with pytest.raises(InputError, match="the end after 2 Gaussians"):
            read(tmp_path, data)

    assert most_memory(inflate) < 50_000_000


def test_a_zstd_bomb_is_not_inflated(tmp_path: Path):
    import zstandard

    blocks = spz_blocks(4)
    data = spz(4, blocks)
    stream, bomb = (
        zstandard.ZstdCompressor().compress(blocks[0]),
        zstandard.ZstdCompressor().compress(bytes(100_000_000)),
    )
    data = data.replace(stream, bomb).replace(struct.pack("<QQ", len(stream), 18), struct.pack("<QQ", len(bomb), 18))
    with pytest.raises(InputError, match="stream 0: expected 18 bytes, found more"):
        read(tmp_path, data)


def test_without_zstandard_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    data, found = spz(4, spz_blocks(4)), builtins.__import__

    def missing(name: str, *rest: object) -> object:
        if name == "zstandard":
            raise ImportError(name)
        return found(name, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(ImportError, match=r"SPZ files of version 4 need zstandard: pip install -e '.\[spz\]'"):
        read(tmp_path, data)
