"""The size of a clip is known before anything decodes it, and frames larger than that are not decoded."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from semgs.app.limits import Limits
from semgs.app.uploads import UnusableUploadError, Upload, prepare
from semgs.files.errors import InputError
from semgs.sfm import clips
from semgs.sfm.clip_headers import check_clip_size, is_mirrored, read_clip_sizes


def box(name: bytes, *contents: bytes) -> bytes:
    """A box of an MP4."""
    content = b"".join(contents)
    return struct.pack(">I", 8 + len(content)) + name + content


def track(kind: bytes, width: int, height: int, *, wide: bool = False) -> bytes:
    """A track of an MP4 with one sample description; `wide` gives its box a length of 64 bits, as files of over 4 GB have."""
    entry = box(b"avc1", bytes(24), struct.pack(">2H", width, height), bytes(50))
    media = box(b"minf", box(b"hdlr", bytes(8), b"alis"), box(b"stbl", box(b"stsd", bytes(7), b"\1", entry)))
    inside = box(b"mdia", box(b"hdlr", bytes(8), kind, bytes(12)), media)
    return (
        struct.pack(">I", 1) + b"trak" + struct.pack(">Q", 16 + len(inside)) + inside if wide else box(b"trak", inside)
    )


def mp4(*tracks: bytes) -> bytes:
    """The header of an MP4, behind its frames, as phones write it."""
    return box(b"ftyp", b"isom", bytes(4)) + box(b"mdat", bytes(99)) + box(b"moov", box(b"mvhd", bytes(100)), *tracks)


def element(name: int, content: bytes, *, endless: bool = False) -> bytes:
    """An element of a Matroska file; `endless` leaves its length open, as browsers do that record."""
    length = b"\1" + 7 * b"\xff" if endless else (1 << 56 | len(content)).to_bytes(8)
    return name.to_bytes((name.bit_length() + 7) // 8) + length + content


def webm(width: int, height: int, *, endless: bool = False) -> bytes:
    """The header of a WebM with a track of sound and one of pictures."""
    video = element(0xE0, element(0xB0, width.to_bytes(2)) + element(0xBA, height.to_bytes(4)))
    tracks = element(0x1654AE6B, element(0xAE, element(0xE1, b"")) + element(0xAE, element(0xD7, b"\2") + video))
    return element(0x1A45DFA3, b"") + element(0x18538067, element(0x114D9B74, b"x") + tracks, endless=endless)


def avi(width: int, height: int, pictures: list[bytes] = ()) -> bytes:  # type: ignore[assignment]
    """An AVI of JPEGs."""

    def chunk(name: bytes, content: bytes) -> bytes:
        return name + struct.pack("<I", len(content)) + content + bytes(len(content) % 2)

    main = chunk(b"avih", struct.pack("<14I", 100_000, 0, 0, 16, len(pictures), 0, 1, 0, width, height, 0, 0, 0, 0))
    stream = b"vidsMJPG" + struct.pack("<10I4H", 0, 0, 0, 1, 10, 0, len(pictures), 0, 0, 0, 0, 0, width, height)
    form = (
        struct.pack("<I2i2H", 40, width, -height, 1, 24) + b"MJPG" + struct.pack("<5I", 3 * width * height, 0, 0, 0, 0)
    )
    header = chunk(b"LIST", b"hdrl" + main + chunk(b"LIST", b"strl" + chunk(b"strh", stream) + chunk(b"strf", form)))
    frames = chunk(b"LIST", b"movi" + b"".join(chunk(b"00dc", one) for one in pictures))
    return chunk(b"RIFF", b"AVI " + header + frames)


ANNOUNCED = {
    "an MP4": (mp4(track(b"soun", 9000, 9000), track(b"vide", 640, 480)), [(480, 640)]),
    "an MP4 of two tracks": (mp4(track(b"vide", 30, 20), track(b"vide", 50, 40, wide=True)), [(20, 30), (40, 50)]),
    "an MP4 with data beside": (mp4(track(b"meta", 9000, 9000), track(b"vide", 640, 480)), [(480, 640)]),
    "a WebM": (webm(640, 480), [(480, 640)]),
    "a WebM of unknown length": (webm(640, 480, endless=True), [(480, 640)]),
    "an AVI": (avi(640, 480), [(480, 640)]),
    "text": (b"hello", []),
    "nothing": (b"", []),
    "an MP4 that is cut off": (mp4(track(b"vide", 640, 480))[:-100], []),
    "boxes inside one another": (50_000 * b"\0\0\0\0moov", []),
    "boxes of no length": (box(b"ftyp") + 9 * b"\0\0\0\1moov\0\0\0\0\0\0\0\0", []),
    "lists inside one another": (b"RIFF\xff\xff\xff\xffAVI " + 50_000 * b"LIST\xff\xff\xff\x7fhdrl", []),
    "elements inside one another": (element(0x1A45DFA3, b"") + 50_000 * b"\x18\x53\x80\x67\xff", []),
    "zeros": (b"\x1aE\xdf\xa3" + bytes(5000), []),
}  # fmt: skip


@pytest.mark.parametrize("name", ANNOUNCED)
def test_sizes_are_those_in_the_header(tmp_path: Path, name: str):
    data, sizes = ANNOUNCED[name]
    (tmp_path / "a.mp4").write_bytes(data)
    assert read_clip_sizes(tmp_path / "a.mp4") == sizes


@pytest.mark.parametrize(("ending", "codec"), [("mp4", "mp4v"), ("avi", "MJPG"), ("webm", "VP80"), ("mkv", "MJPG")])
def test_clips_of_opencv_announce_their_size(tmp_path: Path, ending: str, codec: str):
    path = tmp_path / f"a.{ending}"
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 10, (64, 48))
    video.write(np.zeros((48, 64, 3), np.uint8))
    video.release()
    assert read_clip_sizes(path) == [(48, 64)]


def test_a_clip_may_have_as_many_pixels_as_allowed_and_not_one_row_more(tmp_path: Path):
    (tmp_path / "a.mov").write_bytes(mp4(track(b"vide", 100, 80)))
    check_clip_size(tmp_path / "a.mov", 8000)
    with pytest.raises(InputError, match=r"expected frames of at most 7,900 pixels, found 100x80$"):
        check_clip_size(tmp_path / "a.mov", 7900)


def test_tracks_of_frames_count_together(tmp_path: Path):
    (tmp_path / "a.mov").write_bytes(mp4(track(b"vide", 100, 60), track(b"vide", 40, 50), track(b"vide", 30, 10)))
    check_clip_size(tmp_path / "a.mov", 8300)
    with pytest.raises(InputError, match="found 100x60 in one of 3 tracks"):
        check_clip_size(tmp_path / "a.mov", 8299)


def test_the_app_refuses_a_clip_by_its_header_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(cv2, "VideoCapture", None)
    (tmp_path / "up.mp4").write_bytes(mp4(track(b"vide", 16000, 16000)))
    (tmp_path / "work").mkdir()
    clip = Upload(tmp_path / "up.mp4", "walk.mp4")
    with pytest.raises(
        UnusableUploadError, match=r"^walk\.mp4 has 16000x16000 pixels; frames of at most 64 megapixels"
    ):
        prepare("clip", [clip], tmp_path / "work", Limits(), lambda title: None)
    with pytest.raises(InputError, match="at most 67,108,864 pixels, found 16000x16000"):
        clips.copy_frames(tmp_path / "up.mp4", tmp_path / "work", 8)


def test_a_clip_whose_frames_are_larger_than_its_header_says_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(clips, "MOST_PIXELS", 64 * 48 - 1)
    monkeypatch.setattr(clips, "check_clip_size", lambda path: None)
    video = cv2.VideoWriter(str(tmp_path / "a.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 10, (64, 48))
    video.write(np.zeros((48, 64, 3), np.uint8))
    video.release()
    with pytest.raises(InputError, match="at most 3,071 pixels, found 64x48"):
        clips.copy_frames(tmp_path / "a.mp4", tmp_path, 8)


def test_more_frames_than_an_hour_has_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(clips, "MOST_FRAMES", 3)
    video = cv2.VideoWriter(str(tmp_path / "a.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 10, (64, 48))
    for _ in range(4):
        video.write(np.zeros((48, 64, 3), np.uint8))
    video.release()
    with pytest.raises(InputError, match="a clip of at most 3 frames, found more; cut it"):
        clips.copy_frames(tmp_path / "a.mp4", tmp_path, 8)


def test_of_a_clip_that_has_more_frames_than_it_says_only_the_first_are_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(clips, "MOST_JUDGED", 2)
    monkeypatch.setattr(clips, "_count_frames", lambda path: 1)
    video = cv2.VideoWriter(str(tmp_path / "a.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 10, (64, 48))
    for _ in range(9):
        video.write(np.zeros((48, 64, 3), np.uint8))
    video.release()
    assert [one.index for one in clips._judged(tmp_path / "a.mp4")] == [0, 1, 2, 3]


@pytest.mark.skipif(sys.platform != "linux", reason="frames that grow are stopped on Linux")
def test_frames_that_become_much_larger_on_the_way_are_not_decoded(tmp_path: Path):
    """The second has 72 megapixels of a byte; after a first one of 64x48, FFmpeg may take 64 MiB at once. In a process of its own, which keeps that limit."""
    pictures = []
    for size in ((64, 48), (9000, 8000)):
        buffer = io.BytesIO()
        Image.new("L", size, 90).save(buffer, "JPEG", quality=50)
        pictures.append(buffer.getvalue())
    (tmp_path / "a.avi").write_bytes(avi(64, 48, pictures))
    lines = [
        "import sys, cv2",
        "from semgs.sfm.clip_headers import limit_frames",
        "limit_frames(64 * 48)",
        "video = cv2.VideoCapture(sys.argv[1])",
        "print([video.grab(), video.grab()])",
    ]
    told = subprocess.run(
        [sys.executable, "-c", "\n".join(lines), str(tmp_path / "a.avi")],
        capture_output=True,
        text=True,
        check=True,
        timeout=100,
    )
    assert told.stdout == "[True, False]\n"


def movie(mirrored: bool, *tracks: bool, version: int = 0) -> bytes:
    """An MP4 of video tracks; headers of version 1 have longer times. A mirroring matrix begins with -1, 0, 0, 0, 1."""

    def header(name: bytes, place: int, mirrors: bool) -> bytes:
        numbers = struct.pack(">5i", (-1 if mirrors else 1) << 16, 0, 0, 0, 1 << 16)
        return box(name, bytes([version]), bytes(place + 12 * version - 1), numbers, bytes(16))

    boxes = [box(b"trak", header(b"tkhd", 40, one), track(b"vide", 64, 48)[8:]) for one in tracks]
    return box(b"ftyp", b"isom", bytes(4)) + box(b"moov", header(b"mvhd", 36, mirrored), *boxes)


@pytest.mark.parametrize("version", [0, 1])
@pytest.mark.parametrize(("whole", "tracks"), [(False, False), (False, True), (True, False), (True, True)])
def test_matrices_of_a_movie_and_its_track_mirror_together(tmp_path: Path, whole: bool, tracks: bool, version: int):
    """Mirrored twice is not mirrored."""
    (tmp_path / "a.mp4").write_bytes(movie(whole, tracks, version=version))
    assert is_mirrored(tmp_path / "a.mp4") is (whole != tracks)


def mkv(yaw: bytes) -> bytes:
    """The header of a Matroska file whose projection has a yaw."""
    video = element(0xE0, element(0xB0, b"\x40") + element(0x7670, element(0x7673, yaw)))
    return element(0x1A45DFA3, b"") + element(0x18538067, element(0x1654AE6B, element(0xAE, video)))


def test_clips_are_refused_if_it_is_unknown_whether_their_frames_come_mirrored(tmp_path: Path):
    """Two tracks of which one is mirrored, and a yaw of 180 degrees; a yaw of 90 degrees is of a panorama."""
    for name, data in (("a.mp4", movie(False, True, False)), ("b.mkv", mkv(struct.pack(">d", 180))), ("c.mkv", mkv(struct.pack(">f", -180)))):  # fmt: skip
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match="expected a clip that is not mirrored by its header, found one that is; "):
            is_mirrored(tmp_path / name)
    for name, data in (("d.mkv", mkv(struct.pack(">f", 90))), ("e.webm", webm(64, 48)), ("f.avi", avi(64, 48))):
        (tmp_path / name).write_bytes(data)
        assert not is_mirrored(tmp_path / name)
