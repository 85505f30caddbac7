"""What can be dropped: wrong files get a sentence, archives cannot write elsewhere, photos come out upright and small."""

from __future__ import annotations

import io
import re
import stat
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from dropped_files import picture, with_link, written, zipped
from PIL import Image

from semgs.app.limits import Limits
from semgs.app.uploads import LONGEST_SIDE, UnusableUploadError, Upload, check_uploads, photo_names, prepare, unpack
from semgs.files.images.pictures import read_optics, read_rgb
from semgs.files.text import natural_order

SMALL = Limits(file_bytes=40_000, total_bytes=60_000, photos=3, pixels=10_000, members=5, unpacked_bytes=50_000)


def lying(path: Path) -> Upload:
    """An archive whose list says one byte for a member of a thousand."""
    upload = zipped(path, {"a.txt": bytes(1000)})
    data = bytearray(path.read_bytes())
    at = data.index(b"PK\1\2")
    data[at + 24 : at + 28] = (1).to_bytes(4, "little")
    path.write_bytes(data)
    return upload


def damaged(path: Path, method: int) -> Upload:
    """An archive with a member of 3,000 random bytes of 16 kinds, in whose compressed data some bits are wrong."""
    content = bytes(np.random.default_rng(5).integers(0, 16, 3000, np.uint8))
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("a.txt", content)
    data = bytearray(path.read_bytes())
    data[60:100] = bytes(40)
    path.write_bytes(data)
    return Upload(path, path.name)


WRONG: dict[str, tuple[Callable[[Path], list[Upload]], str]] = {
    "nothing": (lambda folder: [], "Nothing was dropped"),
    "one photo": (lambda folder: [picture(folder / "a.jpg")], "One photo is not enough"),
    "four photos": (lambda folder: [picture(folder / f"{n}.jpg", seed=n) for n in range(4)], "4 photos are too many"),
    "text": (lambda folder: [written(folder / "notes.txt", b"hello")], "notes.txt: .txt files cannot be read"),
    "no ending": (lambda folder: [written(folder / "photo", b"hello")], "files without an ending"),
    "webp": (lambda folder: [picture(folder / "a.webp"), picture(folder / "b.webp")], ".webp files"),
    "empty": (lambda folder: [written(folder / "a.jpg", b""), picture(folder / "b.jpg")], "a.jpg is empty"),
    "large": (lambda folder: [written(folder / "a.jpg", bytes(50_000))], "at most 0 MB"),
    "large together": (lambda folder: [written(folder / f"{n}.jpg", bytes(30_000)) for n in range(3)], "together"),
    "a mixture": (lambda folder: [picture(folder / "a.jpg"), written(folder / "b.mp4", b"x")], "b.mp4 alone"),
    "two zips": (lambda folder: [zipped(folder / f"{n}.zip", {"a": b""}) for n in range(2)], "alone"),
    "broken photos": (lambda folder: [written(folder / f"{n}.jpg", b"junk") for n in range(2)], "Fewer than two photos"),
    "cut off": (
        lambda folder: [written(folder / f"{n}.jpg", picture(folder / "x.jpg").path.read_bytes()[:900]) for n in range(2)],
        "Damaged: 0.jpg, 1.jpg",
    ),
    "many pixels": (lambda folder: [picture(folder / f"{n}.jpg", (120, 100), n, quality=10) for n in range(2)], "120x100 pixels"),
    "no zip": (lambda folder: [written(folder / "a.zip", b"junk")], "is not a zip that can be read"),
    "an empty zip": (lambda folder: [zipped(folder / "a.zip", {})], "an empty zip"),
    "a zip of many": (lambda folder: [zipped(folder / "a.zip", {str(n): b"" for n in range(6)})], "contains 6 files"),
    "a bomb": (lambda folder: [zipped(folder / "a.zip", {"a": bytes(1_000_000)})], "would unpack to"),
    "traversal": (lambda folder: [zipped(folder / "a.zip", {"../a": b"x"})], "leads outside"),
    "an absolute path": (lambda folder: [zipped(folder / "a.zip", {"/a": b"x"})], "leads outside"),
    "a drive": (lambda folder: [zipped(folder / "a.zip", {"C:/a": b"x"})], "leads outside"),
    "a file without a name": (lambda folder: [zipped(folder / "a.zip", {".": b"x"})], "a file without a name"),
    "a pipe": (lambda folder: [with_link(folder / "a.zip", stat.S_IFIFO)], "contains a device or a pipe"),
    "a link": (lambda folder: [with_link(folder / "a.zip")], "contains a link"),
    "deflated damage": (lambda folder: [damaged(folder / "a.zip", zipfile.ZIP_DEFLATED)], "a.zip is not a zip that can be read"),
    "LZMA": (lambda folder: [damaged(folder / "a.zip", zipfile.ZIP_LZMA)], "compressed by LZMA, which is not read"),
    "a lie": (lambda folder: [lying(folder / "a.zip")], "a.zip"),
    "a zip in which a file is a folder": (lambda folder: [zipped(folder / "a.zip", {"a": b"x", "a/b": b"x"})], "a file and a folder of the same name"),
    "vanished": (lambda folder: [Upload(folder / "a.jpg", "a.jpg"), picture(folder / "b.jpg")], "no longer on the server"),
}  # fmt: skip
"""What users drop by mistake or on purpose, and the sentence that they get."""


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_used_gets_a_sentence_and_leaves_nothing_outside(tmp_path: Path, name: str):
    make, expected = WRONG[name]
    (tmp_path / "dropped").mkdir()
    (tmp_path / "work").mkdir()
    uploads = make(tmp_path / "dropped")
    with pytest.raises(UnusableUploadError) as raised:
        prepare(check_uploads(uploads, SMALL), uploads, tmp_path / "work", SMALL, lambda title: None)
    sentence = str(raised.value)
    assert expected in sentence
    assert sentence.endswith(".")
    assert str(tmp_path) not in sentence
    assert {path.name for path in tmp_path.iterdir()} == {"dropped", "work"}


def test_photos_come_out_upright_small_and_with_their_focal_length(tmp_path: Path):
    exif = Image.Exif()
    exif[0x0112] = 6  # to be turned clockwise
    exif.get_ifd(0x8769)[0xA405] = 26
    uploads = [picture(tmp_path / "a.jpg", (2048, 1024), exif=exif), picture(tmp_path / "b.png", (30, 50), 1)]
    before = read_optics(uploads[0].path).focal_px
    prepared = prepare("photos", uploads, tmp_path, Limits(), lambda title: None)
    assert prepared.notes == ()
    assert [read_rgb(path).shape for path in sorted(prepared.scene.iterdir())] == [(LONGEST_SIDE, 512, 3), (50, 30, 3)]
    assert before is not None
    assert read_optics(prepared.scene / "a.jpg").focal_px == pytest.approx(before / 2, rel=0.03)


def test_a_damaged_photo_among_good_ones_is_left_out_and_named(tmp_path: Path):
    uploads = [picture(tmp_path / "a.jpg"), written(tmp_path / "b.jpg", b"junk"), picture(tmp_path / "c.jpg", seed=1)]
    prepared = prepare("photos", uploads, tmp_path, Limits(), lambda title: None)
    assert sorted(path.name for path in prepared.scene.iterdir()) == ["a.jpg", "c.jpg"]
    assert prepared.notes == ("b.jpg is damaged and was left out.",)
    assert prepared.photos == {1: "a.jpg", 3: "c.jpg"}  # the third that was dropped stays the third


def test_a_zip_of_photos_is_photos_and_clutter_is_ignored(tmp_path: Path):
    buffer = io.BytesIO()
    Image.new("RGB", (30, 20), "red").save(buffer, "PNG")
    archive = zipped(
        tmp_path / "a.zip",
        {
            "trip/a.png": buffer.getvalue(),
            "trip/b.png": buffer.getvalue(),
            "__MACOSX/trip/._a.png": b"x",
            "trip/.DS_Store": b"x",
        },
    )
    prepared = prepare("archive", [archive], tmp_path, Limits(), lambda title: None)
    assert prepared.scene.name == "photos"
    assert sorted(path.name for path in prepared.scene.iterdir()) == ["a.jpg", "b.jpg"]


def test_a_zip_of_a_cameras_card_is_photos_in_the_order_of_its_folders(tmp_path: Path):
    first, second = picture(tmp_path / "a.jpg", (30, 20)), picture(tmp_path / "b.jpg", (40, 20))
    members = {
        "DCIM/100APPLE/IMG_9.JPG": first.path.read_bytes(),
        "DCIM/101APPLE/IMG_1.JPG": second.path.read_bytes(),
        "DCIM/101APPLE/IMG_2.webp": b"a format that is not read",
    }
    archive = zipped(tmp_path / "a.zip", members)
    prepared = prepare("archive", [archive], tmp_path, Limits(), lambda title: None)
    assert prepared.notes == ()
    assert prepared.photos == {1: "001_IMG_9.jpg", 2: "002_IMG_1.jpg"}
    assert [read_rgb(path).shape for path in sorted(prepared.scene.iterdir())] == [(20, 30, 3), (20, 40, 3)]


def test_a_zip_of_one_photo_is_too_little_and_calls_none_damaged(tmp_path: Path):
    archive = zipped(tmp_path / "a.zip", {"a.jpg": picture(tmp_path / "a.jpg").path.read_bytes()})
    with pytest.raises(UnusableUploadError, match=r"^Fewer than two photos can be read\.$"):
        prepare("archive", [archive], tmp_path, Limits(), lambda title: None)


def test_a_panorama_is_still_one_when_it_is_reduced(tmp_path: Path):
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA401] = 6
    uploads = [picture(tmp_path / "a.jpg", exif=exif), picture(tmp_path / "b.jpg", seed=1)]
    scene = prepare("photos", uploads, tmp_path, Limits(), lambda title: None).scene
    assert [read_optics(path).panorama for path in sorted(scene.iterdir())] == [True, False]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["0007.jpg", "0012.JPG"], ["0007.jpg", "0012.jpg"]),
        (["IMG_9.HEIC", "IMG_10.png"], ["IMG_9.jpg", "IMG_10.jpg"]),  # by value, 9 is before 10
        (["Küche 1.JPG", "Küche 1.JPG"], ["Kuche_1.jpg", "Kuche_1_2.jpg"]),
        (["a.jpg", "A.png", "a_2.jpg"], ["a.jpg", "A_2.jpg", "a_2_2.jpg"]),
        (["b.jpg", "a.jpg"], ["001_b.jpg", "002_a.jpg"]),  # the order is that in which they were dropped
        (["../x.jpg"], ["x.jpg"]), (["C:\\a\\x.jpg"], ["x.jpg"]), (["-rf.jpg"], ["rf.jpg"]), ([".a.jpg"], ["a.jpg"]), (["...jpg"], ["photo.jpg"]),
        (["CON.jpg"], ["_CON.jpg"]), (["com1.x.png"], ["_com1.x.jpg"]), (["console.jpg"], ["console.jpg"]), (["写真.jpg"], ["_.jpg"]),
        (["a\nb\0.jpg"], ["a_b_.jpg"]), (["a" * 296 + ".jpg"], ["a" * 60 + ".jpg"]), (["a" * 61 + ".jpg", "a" * 62 + ".jpg"], ["a" * 60 + ".jpg", "a" * 60 + "_2.jpg"]),
    ],
)  # fmt: skip
def test_photos_keep_their_names_as_far_as_every_disk_allows(names: list[str], expected: list[str]):
    assert photo_names(names) == expected


def test_names_of_photos_are_apart_and_in_the_order_given_whatever_they_are():
    letters = np.random.default_rng(0).choice(list("aA1.-_ é/\\"), (200, 12, 4))
    for drawn in letters:
        names = photo_names(["".join(name) + ".jpg" for name in drawn])
        assert len({name.lower() for name in names}) == 12
        assert sorted(names, key=natural_order) == names
        assert all(re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9._-]*\.jpg", name) for name in names)


def test_a_clip_stays_where_it_was_for_another_room(tmp_path: Path):
    clip = written(tmp_path / "a.mp4", b"a clip")
    (tmp_path / "work").mkdir()
    prepared = prepare("clip", [clip], tmp_path / "work", Limits(), lambda title: None)
    assert (prepared.photos, prepared.scene.read_bytes(), clip.path.read_bytes()) == ({}, b"a clip", b"a clip")


def test_an_honest_archive_keeps_its_folders(tmp_path: Path):
    upload = zipped(tmp_path / "a.zip", {"room/transforms.json": b"{}", "room/images/0.jpg": b"x"})
    unpack(upload, tmp_path / "out", Limits())
    assert (tmp_path / "out/room/images/0.jpg").read_bytes() == b"x"


@pytest.mark.parametrize("name", ["../../etc/passwd", "a" * 300 + ".jpg", "C:\\photos\\x.jpg", "line\nbreak.jpg"])
def test_names_from_a_browser_are_shown_short_and_without_folders(tmp_path: Path, name: str):
    shown = Upload(tmp_path, name).shown
    assert len(shown) <= 60
    assert not {"/", "\\", "\n"} & set(shown)
