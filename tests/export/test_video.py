"""Videos, read back by PyAV."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from semgs.export.video import BT709, write_video

av = pytest.importorskip("av")


def frames(size: tuple[int, int], count: int) -> Iterator[np.ndarray]:
    """Red grows to the right, green downwards and blue with time."""
    rows, columns = (np.linspace(30, 220, side) for side in size)
    for index in range(count):
        image = np.zeros((*size, 3))
        image[..., 0], image[..., 1], image[..., 2] = columns, rows[:, None], 40 * index
        yield image.astype(np.uint8)


def boxes(path: Path) -> list[str]:
    """The names of the boxes of an MP4 file, in order: each begins with its length and its name."""
    data, at, found = path.read_bytes(), 0, []
    while at < len(data):
        found.append(data[at + 4 : at + 8].decode())
        at += int.from_bytes(data[at : at + 4], "big")
    return found


def test_a_video_is_h264_in_yuv420p_with_even_sides_its_index_in_front_and_its_colours_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    write_video(path, frames((61, 83), 5), fps=25)
    assert [one.name for one in tmp_path.iterdir()] == ["a.mp4"]
    found = boxes(path)
    assert found.index("moov") < found.index("mdat")
    with av.open(str(path)) as container:
        (stream,) = container.streams
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.codec_context.height, stream.codec_context.width) == (60, 82)
        assert stream.average_rate == 25
        decoded = list(container.decode(video=0))
    tags = [int(getattr(decoded[0], name)) for name in ("colorspace", "color_primaries", "color_trc", "color_range")]
    assert tags == [BT709, BT709, BT709, 1]
    assert len(decoded) == 5
    for given, frame in zip(frames((61, 83), 5), decoded, strict=True):
        shown = frame.to_ndarray(format="rgb24", src_colorspace="ITU709").astype(int)
        assert np.abs(shown - given[:60, :82]).mean() < 2
        assert np.abs(shown - given[:60, :82]).max() < 20


def test_if_the_images_end_in_an_error_nothing_is_left_and_an_older_video_stays(tmp_path: Path) -> None:
    def broken() -> Iterator[np.ndarray]:
        yield from frames((32, 48), 2)
        raise KeyboardInterrupt

    path = tmp_path / "a.mp4"
    with pytest.raises(KeyboardInterrupt):
        write_video(path, broken(), fps=30)
    assert list(tmp_path.iterdir()) == []
    path.write_bytes(b"older")
    with pytest.raises(KeyboardInterrupt):
        write_video(path, broken(), fps=30)
    assert [one.read_bytes() for one in tmp_path.iterdir()] == [b"older"]


def test_without_the_library_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(ImportError, match=r"pip install -e '\.\[video\]'"):
        write_video(tmp_path / "a.mp4", frames((32, 48), 1), fps=30)
    assert list(tmp_path.iterdir()) == []


def test_errors_of_the_system_name_the_video(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file") as caught:
        write_video(tmp_path / "none" / "a.mp4", frames((32, 48), 1), fps=30)
    assert caught.value.filename == str(tmp_path / "none" / "a.mp4")
