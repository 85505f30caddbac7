"""A clip is a video that contains its frames: what lists other files or addresses is refused, and nothing that a video names is opened."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from clip_files import write_clip

from semgs.files.errors import InputError
from semgs.sfm.clip_headers import OPTIONS, VARIABLE, check_container
from semgs.sfm.clips import copy_frames

SIZE = (120, 160)


def frames(count: int = 6) -> list[np.ndarray]:
    """Noise that moves to the left."""
    noise = np.random.default_rng(3).integers(0, 255, (SIZE[0] // 8, SIZE[1] // 4, 3), np.uint8)
    wide = np.kron(noise, np.ones((8, 8, 1), np.uint8))
    return [wide[:, 8 * index : 8 * index + SIZE[1]] for index in range(count)]


@pytest.mark.parametrize(
    ("name", "codec"), [("a.mp4", "mp4v"), ("a.mov", "mp4v"), ("a.m4v", "mp4v"), ("a.avi", "MJPG"), ("a.mkv", "MJPG"), ("a.webm", "VP80")]
)  # fmt: skip
def test_frames_are_copied_from_every_container(tmp_path: Path, name: str, codec: str):
    clip = write_clip(tmp_path / name, frames(), codec=codec)
    (tmp_path / "out").mkdir()
    assert len(copy_frames(clip, tmp_path / "out", 4).photos) >= 2


def two_streams(path: Path, first: list[np.ndarray], second: list[np.ndarray], *, attached: bool = False) -> Path:
    """A clip of two video streams; `attached` makes the first one the picture of the file."""
    av = pytest.importorskip("av")
    with av.open(str(path), "w") as file:
        streams = [file.add_stream(codec, rate=10) for codec in ("mjpeg", "mpeg4")]
        for stream, pictures, form in zip(streams, (first, second), ("yuvj420p", "yuv420p"), strict=True):
            stream.height, stream.width = pictures[0].shape[:2]
            stream.pix_fmt = form
        if attached:
            streams[0].disposition = av.stream.Disposition.attached_pic
        for stream, pictures in zip(streams, (first, second), strict=True):
            for picture in pictures:
                file.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(picture))))
            file.mux(stream.encode())
    return path


@pytest.mark.parametrize("ending", [".mp4", ".mov", ".mkv"])
@pytest.mark.parametrize("grey", [99, 0])
def test_a_thumbnail_in_the_first_stream_is_named_with_what_removes_it(tmp_path: Path, ending: str, grey: int):
    """FFmpeg counts the video streams from 0."""
    thumbnail = np.full((48, 64, 3), grey, np.uint8)
    clip = two_streams(tmp_path / f"a{ending}", [thumbnail], frames())
    told = (
        r"expected a video whose first stream has its frames, found a thumbnail of 64x48 there and the frames of 160x120 "
        rf"behind it; remove it: ffmpeg -i a\{ending} -map 0:v:1 -c copy converted\{ending}"
    )
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match=told):
        copy_frames(clip, tmp_path / "out", 4)


def test_a_small_stream_that_shows_motion_is_read_with_a_note(tmp_path: Path):
    small = [np.ascontiguousarray(one[::2, ::2]) for one in frames()]
    clip = two_streams(tmp_path / "a.mp4", small, frames())
    (tmp_path / "out").mkdir()
    found = copy_frames(clip, tmp_path / "out", 4)
    assert {photo.size for photo in found.photos} == {(60, 80)}
    assert any("the first, of 80x60, was read, not that of 160x120" in note for note in found.notes)


def test_a_picture_of_the_file_behind_the_frames_changes_nothing(tmp_path: Path):
    clip = two_streams(tmp_path / "a.mp4", [frames(1)[0][:48, :64]], frames(), attached=True)
    (tmp_path / "out").mkdir()
    found = copy_frames(clip, tmp_path / "out", 4)
    assert {photo.size for photo in found.photos} == {SIZE}
    assert not any("streams" in note for note in found.notes)


LISTS: dict[str, Callable[[Path], str]] = {
    "an HLS playlist": lambda real: f"#EXTM3U\n#EXT-X-TARGETDURATION:10\n#EXTINF:10,\n{real}\n#EXT-X-ENDLIST\n",
    "a playlist with an address": lambda real: "#EXTM3U\n#EXTINF:10,\nhttp://127.0.0.1:9/a.ts\n#EXT-X-ENDLIST\n",
    "a script of ffmpeg": lambda real: f"ffconcat version 1.0\nfile {real}\n",
    "a script that names a neighbour": lambda real: f"ffconcat version 1.0\nfile {real.name}\n",
    "a description of a session": lambda real: "v=0\no=- 0 0 IN IP4 127.0.0.1\nc=IN IP4 127.0.0.1\nm=video 5004 RTP/AVP 96\n",
    "a manifest of DASH": lambda real: f'<?xml version="1.0"?><MPD><Period><BaseURL>{real}</BaseURL></Period></MPD>',
    "an image of another": lambda real: f'<svg><image href="{real}"/></svg>',
    "a list in a file's clothes": lambda real: f"RIFF    ffconcat version 1.0\nfile {real}\n",
    "nothing": lambda real: "",
}  # fmt: skip


@pytest.mark.parametrize("kind", LISTS)
def test_a_list_of_other_files_is_no_clip(tmp_path: Path, kind: str):
    real = write_clip(tmp_path / "real.mp4", frames())
    (tmp_path / "a.mp4").write_text(LISTS[kind](real))
    with pytest.raises(InputError, match="expected a video in MP4, MOV, AVI, MKV or WebM, found") as raised:
        copy_frames(tmp_path / "a.mp4", tmp_path, 4)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("kind", LISTS)
def test_ffmpeg_itself_opens_no_list(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, capfd):
    """The second line of defence: what begins like a video and is read as a list."""
    real = write_clip(tmp_path / "real.mp4", frames())
    (tmp_path / "a.mp4").write_text(LISTS[kind](real))
    monkeypatch.setattr("semgs.sfm.clips.check_container", lambda path: None)
    monkeypatch.setenv(VARIABLE, "hwaccel;none")
    with pytest.raises(InputError, match="expected a video that OpenCV can decode, found no frames"):
        copy_frames(tmp_path / "a.mp4", tmp_path, 4)
    assert os.environ[VARIABLE] == "hwaccel;none"
    assert "/real.mp4" not in capfd.readouterr().err.replace("Unsafe file name", "")


def boxes(data: bytes) -> list[tuple[bytes, bytes]]:
    """Type and content of each box."""
    found, start = [], 0
    while start < len(data):
        size = int.from_bytes(data[start : start + 4], "big")
        found.append((data[start + 4 : start + 8], data[start + 8 : start + size]))
        start += size
    return found


def box(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I4s", 8 + len(content), kind) + content


def pointing(data: bytes, place: str, levels: int) -> bytes:
    """An MP4 whose samples are in another file, by the alias that QuickTime writes (`alis`): so many folders above, or at a path for 0."""

    def alias() -> bytes:
        name, path = Path(place).name.encode()[:63], place.encode() + b"\0" * (len(place) % 2)
        content = bytes(4) + bytes(10) + b"\1X" + bytes(26) + bytes(12) + bytes([len(name)]) + name.ljust(63, b"\0")
        content += bytes(16) + struct.pack(">hh", levels, levels) + bytes(16)
        for kind, text in ((2, path), (18, path)):
            content += struct.pack(">hH", kind, len(text)) + text
        return content + struct.pack(">hH", -1, 0) + bytes(40)

    def changed(kind: bytes, content: bytes) -> bytes:
        if kind in (b"moov", b"trak", b"mdia", b"minf", b"dinf"):
            content = b"".join(changed(*one) for one in boxes(content))
        elif kind == b"dref":
            content = content[:8] + box(b"alis", alias())
        elif kind == b"mdat":
            content = bytes(len(content))
        return box(kind, content)

    return b"".join(changed(*one) for one in boxes(data))


def decoded(path: Path) -> int:
    """How many frames that are not of one colour ffmpeg decodes."""
    video, count = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG), 0
    while video.grab():
        count += bool(video.retrieve()[1].std() > 10)
    video.release()
    return count


@pytest.mark.parametrize("relative", [True, False])
def test_samples_in_another_file_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, relative: bool):
    secret = write_clip(tmp_path / "secret.mp4", frames())
    assert decoded(secret) == 6
    place = tmp_path / ("a.mov" if relative else "b/a.mov")
    place.parent.mkdir(exist_ok=True)
    place.write_bytes(pointing(secret.read_bytes(), str(secret), int(relative)))
    monkeypatch.setenv(VARIABLE, "enable_drefs;1|use_absolute_path;1")
    assert decoded(place) == 6, "the file should lead ffmpeg to the other one if it is allowed"
    monkeypatch.setenv(VARIABLE, OPTIONS)
    assert decoded(place) == 0
    check_container(place)
    with pytest.raises(InputError, match="expected a video"):
        copy_frames(place, tmp_path, 4)


@pytest.mark.parametrize(
    "cut", ["in the frames", "in the description", "before the frames", "in a long box", "at a box of no length"]
)
def test_a_clip_that_is_cut_off_is_called_incomplete_by_us_alone(tmp_path: Path, cut: str, capfd):
    """Its description, `moov`, is behind its frames; FFmpeg and OpenCV write lines of their own about that."""
    clip = write_clip(tmp_path / "a.mp4", frames())
    whole = clip.read_bytes()
    frames_at, description_at = whole.index(b"mdat") - 4, whole.index(b"moov") - 4
    assert frames_at < description_at
    clip.write_bytes({
        "in the frames": whole[:-len(whole) // 2],
        "in the description": whole[:-1],
        "before the frames": whole[:frames_at],
        "in a long box": whole[:frames_at] + struct.pack(">I4sQ", 1, b"mdat", 1 << 40) + whole[frames_at:],
        "at a box of no length": whole[:frames_at] + struct.pack(">I4s", 0, b"mdat") + whole[frames_at:],
    }[cut])  # fmt: skip
    told = r"a\.mp4: expected a complete MP4 or MOV, found an incomplete one, cut off while it was recorded or copied; copy it again, or film anew$"
    with pytest.raises(InputError, match=told):
        copy_frames(clip, tmp_path, 4)
    assert capfd.readouterr() == ("", "")


def test_a_clip_whose_boxes_have_long_lengths_is_complete(tmp_path: Path):
    clip = write_clip(tmp_path / "a.mp4", frames())
    whole = clip.read_bytes()
    at = whole.index(b"mdat") - 4
    clip.write_bytes(whole[:at] + struct.pack(">I4sQ", 1, b"free", 16) + whole[at:])
    check_container(clip)


def test_a_name_with_a_pattern_or_a_protocol_is_the_name_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    for name in ("frame_%04d.mp4", "concat:a.mp4", "file:b.mp4"):
        write_clip(tmp_path / "a.mp4", frames()).rename(tmp_path / name)
        (tmp_path / "out").mkdir()
        assert len(copy_frames(Path(name), tmp_path / "out", 4).photos) >= 2
        for file in (tmp_path / "out").iterdir():
            file.unlink()
        (tmp_path / "out").rmdir()
