"""Which photos of a folder are used, and upright copies of them; frames of clips."""

from __future__ import annotations

import os
import re
import shutil
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from clip_files import show_as, with_matrix, write_clip
from PIL import Image

from semgs.cli.main import main
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_optics, read_rgb, read_upright
from semgs.sfm.clips import (
    LEAST_MOTION,
    MIRRORED,
    Judged,
    copy_frames,
    has_uneven_times,
    measure_motion,
    moving,
    sharpest,
)
from semgs.sfm.photos import (
    MOST_PHOTOS,
    PhotoSet,
    check_folder_of_photos,
    copy_photos,
    has_only_photos,
    is_panorama,
    photos_below,
    pictures_in,
    with_focal,
)

HEIGHT, WIDTH = 60, 80


def pixels(seed: int, height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    """A smooth random picture, RGB."""
    coarse = np.random.default_rng(seed).integers(0, 255, (8, 9, 3)).astype(np.uint8)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)


def save(path: Path, array: np.ndarray, **exif: object) -> None:
    """Write a picture with EXIF data: `orientation`, or tags of the Exif part by number."""
    data = Image.Exif()
    if "orientation" in exif:
        data[0x0112] = exif.pop("orientation")
    for tag, value in exif.items():
        data.get_ifd(0x8769)[int(tag[1:], 16)] = value
    Image.fromarray(array).save(path, exif=data, quality=95)


def copied(folder: Path, tmp_path: Path) -> PhotoSet:
    (tmp_path / "copies").mkdir()
    return copy_photos(folder, tmp_path / "copies")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two good photos, IMG_2 and IMG_10."""
    (tmp_path / "photos").mkdir()
    save(tmp_path / "photos" / "IMG_10.jpg", pixels(1))
    save(tmp_path / "photos" / "IMG_2.jpg", pixels(2))
    return tmp_path / "photos"


def test_a_focal_length_of_26_mm_compares_diagonals(tmp_path: Path):
    save(tmp_path / "a.jpg", pixels(0, 300, 400), xA405=26)
    # The diagonal is 500 px, and 43.2666 mm on film: 26 * 500 / 43.2666.
    assert read_optics(tmp_path / "a.jpg").focal_px == pytest.approx(300.46, abs=0.01)


def test_a_focal_length_from_the_density_of_the_sensor(tmp_path: Path):
    save(tmp_path / "a.jpg", pixels(0), x920A=24.0, xA20E=1000.0, xA210=3)  # 1000 px a cm
    assert read_optics(tmp_path / "a.jpg").focal_px == pytest.approx(2400)
    save(tmp_path / "b.jpg", pixels(0), x920A=24.0)
    assert read_optics(tmp_path / "b.jpg").focal_px is None


@pytest.mark.parametrize(("width", "height"), [(1600, 1200), (1200, 1600)])
def test_the_density_of_the_sensor_is_that_of_the_photo_as_it_was_taken(tmp_path: Path, width: int, height: int):
    """24 mm at 1,000 px a cm are 2,400 px of 1,600; the photo was reduced to 400, perhaps turned upright, and its EXIF data were kept: 2,400 / 4."""
    save(tmp_path / "a.jpg", pixels(0, 300, 400), x920A=24.0, xA20E=1000.0, xA210=3, xA002=width, xA003=height)
    assert read_optics(tmp_path / "a.jpg").focal_px == pytest.approx(600)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_photos_are_turned_as_exif_says(tmp_path: Path, orientation: int):
    stored = pixels(0)
    stored[:20, :20] = (255, 0, 0)  # red at the top left of the stored pixels
    save(tmp_path / "a.png", stored, orientation=orientation)
    upright = read_upright(tmp_path / "a.png")
    assert upright.shape[:2] == ((HEIGHT, WIDTH) if orientation < 5 else (WIDTH, HEIGHT))
    # EXIF 2.3: where the first row and column of the stored pixels are in the upright picture.
    top, left = orientation in (1, 2, 5, 6), orientation in (1, 4, 5, 8)
    corner = upright[5 if top else -5, 5 if left else -5]
    assert corner.tolist() == [255, 0, 0]


def test_copies_are_upright_and_read_without_their_exif(folder: Path, tmp_path: Path):
    save(folder / "IMG_3.JPG", pixels(3), orientation=6, xA405=26)
    found = copied(folder, tmp_path)
    assert [photo.name for photo in found.photos] == ["IMG_2.jpg", "IMG_3.jpg", "IMG_10.jpg"]
    assert [photo.original for photo in found.photos] == ["IMG_2.jpg", "IMG_3.JPG", "IMG_10.jpg"]
    assert found.photos[1].size == (WIDTH, HEIGHT)
    assert found.photos[1].focal_px == pytest.approx(26 * 100 / 43.2666, abs=0.01)
    assert read_rgb(tmp_path / "copies" / "IMG_3.jpg").shape == (WIDTH, HEIGHT, 3)
    assert (tmp_path / "copies" / "IMG_2.jpg").read_bytes() == (folder / "IMG_2.jpg").read_bytes()


@pytest.mark.parametrize(("content", "ending"), [("png", "jpg"), ("jpeg", "png"), ("jpeg", "heic"), ("heic", "jpg")])
def test_a_photo_that_is_not_what_its_ending_says_becomes_a_jpeg(
    folder: Path, tmp_path: Path, content: str, ending: str
):
    """COLMAP goes by the ending, and found no features in such a photo, which was then left out as one without overlap."""
    with (folder / f"a.{ending}").open("wb") as file:
        image = Image.fromarray(pixels(3))
        if content == "heic":
            pytest.importorskip("pillow_heif").from_pillow(image).save(file)
        else:
            image.save(file, format=content)
    found = copied(folder, tmp_path)
    assert [photo.name for photo in found.photos] == ["a.jpg", "IMG_2.jpg", "IMG_10.jpg"]
    assert (tmp_path / "copies" / "a.jpg").read_bytes()[:2] == b"\xff\xd8"
    assert np.abs(read_rgb(tmp_path / "copies" / "a.jpg").astype(int) - pixels(3)).mean() < 6


def test_what_cannot_be_used_is_left_out_and_counted(folder: Path, tmp_path: Path):
    shutil.copy(folder / "IMG_2.jpg", folder / "copy.jpg")
    save(folder / "black.jpg", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    save(folder / "wide.jpg", pixels(4, 30, 80))
    save(folder / "stitched.jpg", pixels(5), xA401=6)
    (folder / "damaged.jpg").write_bytes(b"\xff\xd8\xff")
    for name in ("a.webp", "b.CR2"):
        (folder / name).touch()
    found = copied(folder, tmp_path)
    assert [photo.name for photo in found.photos] == ["copy.jpg", "IMG_10.jpg"]
    assert found.notes == (
        "2 of 9 photos have a format that is not read (.cr2, .webp), the first is a.webp.",
        "1 of 9 photos are damaged, the first is damaged.jpg.",
        "2 of 9 photos are panoramas and are left out, the first is stitched.jpg.",
        "1 of 9 photos are black or blank and are left out, the first is black.jpg.",
        "1 of 9 photos are copies of another and are left out, the first is IMG_2.jpg.",
    )


def test_a_strip_of_2000x1_pixels_is_a_panorama(folder: Path, tmp_path: Path):
    """Reduced to a longer side of 480 px, it would be a quarter of a pixel high."""
    save(folder / "strip.png", np.random.default_rng(0).integers(0, 255, (1, 2000, 3)).astype(np.uint8))
    assert copied(folder, tmp_path).notes == ("1 of 3 photos are panoramas and are left out, the first is strip.png.",)


def test_blurred_photos_and_several_sizes_get_a_note(folder: Path, tmp_path: Path):
    noisy = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    for index in range(3):
        save(folder / f"sharp{index}.jpg", np.roll(noisy, index, axis=1))
    save(folder / "large.jpg", cv2.resize(noisy, (100, 90)))
    blurred, sizes = copied(folder, tmp_path).notes
    assert blurred.startswith("2 of 6 photos look blurred")
    assert "2 sizes" in sizes
    assert "5 of 80x60, 1 of 100x90" in sizes


def test_a_given_focal_length_needs_one_size(folder: Path, tmp_path: Path):
    save(folder / "IMG_3.jpg", pixels(3, WIDTH, HEIGHT))
    found = copied(folder, tmp_path)
    assert [photo.focal_px for photo in with_focal(found, 70.0)] == [70.0] * 3
    save(folder / "IMG_4.jpg", pixels(3, WIDTH, HEIGHT + 1))
    shutil.rmtree(tmp_path / "copies")
    with pytest.raises(ValueError, match=r"--focal is for photos of one size; .* has 60x80, 61x80"):
        with_focal(copied(folder, tmp_path), 70.0)


def test_one_photo_and_thousands_are_refused(folder: Path, tmp_path: Path):
    (folder / "IMG_10.jpg").unlink()
    with pytest.raises(InputError, match="expected two or more photos, found 1"):
        copied(folder, tmp_path)
    for index in range(3000):
        (folder / f"{index}.jpg").touch()
    with pytest.raises(
        InputError, match=f"expected at most {MOST_PHOTOS} photos, found 3,001; choose some that overlap"
    ):
        copy_photos(folder, tmp_path / "copies")


def test_only_folders_without_a_scene_and_videos_are_photos(folder: Path, tmp_path: Path):
    assert has_only_photos(folder)
    (tmp_path / "inside").mkdir()
    folder.rename(tmp_path / "inside" / "images")
    assert has_only_photos(tmp_path / "inside")
    assert [path.name for path in pictures_in(tmp_path / "inside")] == ["IMG_2.jpg", "IMG_10.jpg"]
    (tmp_path / "inside" / "transforms.json").touch()
    assert not has_only_photos(tmp_path / "inside")
    (tmp_path / "clip.MP4").touch()
    assert has_only_photos(tmp_path / "clip.MP4")
    with pytest.raises(InputError, match=r"semgs poses CLIP --out OUT estimates them"):
        open_scene(tmp_path / "clip.MP4")


def textured(shift: int) -> np.ndarray:
    wide = cv2.resize(np.random.default_rng(7).integers(0, 255, (24, 60, 3)).astype(np.uint8), (400, 160))
    return np.ascontiguousarray(wide[:, shift : shift + 200])


def test_motion_is_the_shift_over_the_longer_side():
    first, second = (cv2.cvtColor(textured(shift), cv2.COLOR_RGB2GRAY) for shift in (0, 6))
    assert measure_motion(first, second) == pytest.approx(6 / 200, abs=0.003)
    assert measure_motion(first, first) == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize(("ending", "library"), [(".jpg", "pycolmap"), (".mp4", "OpenCV")])
def test_a_name_that_is_not_utf8_is_refused_in_one_line(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str, library: str
):
    """pycolmap took no such name, and OpenCV ended the process."""
    pytest.importorskip("pycolmap")
    path = folder / (os.fsdecode(b"k\xfcche") + ending)
    if ending == ".jpg":
        save(path, pixels(3))
    else:
        path.touch()
    assert main(["poses", str(folder if ending == ".jpg" else path), str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert (
        f"k\\udcfcche{ending}: expected a path in UTF-8, as {library} needs it, found other bytes; rename it" in error
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["photos"]


def test_walking_around_something_moves_what_is_in_front_of_it():
    """The background stays; the third of the picture in front of it moves by 6 of 200 px. A sliver that moves is too little."""
    first, second = (cv2.cvtColor(textured(shift), cv2.COLOR_RGB2GRAY) for shift in (0, 6))
    for columns, expected in ((70, 6 / 200), (15, 0.0)):
        there = first.copy()
        there[:, :columns] = second[:, :columns]
        assert measure_motion(first, there) == pytest.approx(expected, abs=0.003)


def test_the_sharp_frame_of_each_stretch_is_taken(tmp_path: Path):
    # Four stretches of four frames: the third of each is sharp.
    frames = [textured(8 * index) for index in range(16)]
    frames = [one if index % 4 == 2 else cv2.GaussianBlur(one, (0, 0), 4) for index, one in enumerate(frames)]
    (tmp_path / "out").mkdir()
    found = copy_frames(write_clip(tmp_path / "a.mp4", frames), tmp_path / "out", 4)
    assert [photo.name for photo in found.photos] == [f"frame_{index:05d}.jpg" for index in (2, 6, 10, 14)]
    assert found.ordered
    difference = read_rgb(tmp_path / "out" / "frame_00006.jpg").astype(int) - frames[6]
    assert np.abs(difference).mean() < 10  # the frame itself, RGB and not BGR


UNEVEN_MS = [*range(0, 800, 100), *range(1100, 4000, 400)]
"""Eight frames with 0.1 s between them, then eight with 0.4 s, as a phone does when it gets dark: four stretches of 0.975 s have 8, 3, 2 and 3 frames."""


def test_frames_with_uneven_times_are_spread_by_time():
    grey = np.zeros((2, 2), np.uint8)
    frames = [Judged(index, grey, 1.0 + index, time / 1000) for index, time in enumerate(UNEVEN_MS)]
    assert has_uneven_times(frames)
    assert [one.index for one in sharpest(frames, 4, by_time=True)] == [7, 10, 12, 15]
    assert [one.index for one in sharpest(frames, 4)] == [3, 7, 11, 15]
    # Rounded times of 30 frames a second, a clip without times, and one with frames at one time are not uneven.
    for times in ([0, 33, 67, 100], [0, 0, 0, 0], [0, 0, 100, 200]):
        assert not has_uneven_times(
            [replace(one, seconds=time / 1000) for one, time in zip(frames, times, strict=False)]
        )


def test_a_clip_of_a_variable_frame_rate_says_so(tmp_path: Path):
    av = pytest.importorskip("av")
    with av.open(tmp_path / "a.mp4", "w") as file:
        stream = file.add_stream("mpeg4", rate=1000, width=200, height=160, pix_fmt="yuv420p", bit_rate=4_000_000)
        stream.codec_context.time_base = stream.time_base = Fraction(1, 1000)
        for index, time in enumerate(UNEVEN_MS):
            # The last one of each stretch is sharp.
            pixels = textured(8 * index)
            pixels = pixels if index in (7, 10, 12, 15) else cv2.GaussianBlur(pixels, (0, 0), 4)
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), "rgb24")
            frame.pts, frame.time_base = time, Fraction(1, 1000)
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
    (tmp_path / "out").mkdir()
    found = copy_frames(tmp_path / "a.mp4", tmp_path / "out", 4)
    assert [photo.name for photo in found.photos] == [f"frame_{index:05d}.jpg" for index in (7, 10, 12, 15)]
    assert found.notes[0].endswith("It has frames at uneven times; they are spread by time.")


def test_frames_of_a_clip_that_does_not_say_how_many_it_has_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """45 frames without a duration, as browsers record: with at most about 10 to judge, every 4th is, which is 12."""
    clip = write_clip(tmp_path / "a.webm", [textured(2 * index) for index in range(45)], codec="VP80")
    data, duration = clip.read_bytes(), b"\x44\x89\x88"
    assert data.count(duration) == 1
    clip.write_bytes(data.replace(duration, b"\xec\x89\0"))  # an element to be skipped, as long as it
    monkeypatch.setattr("semgs.sfm.clips.MOST_JUDGED", 10)
    (tmp_path / "out").mkdir()
    found = copy_frames(tmp_path / "a.webm", tmp_path / "out", 4)
    assert " of 12 frames of the clip were chosen" in found.notes[0]
    assert len(found.photos) == 4


def test_frames_are_turned_as_the_rotation_flag_says(tmp_path: Path):
    """A phone held upright stores its frames on their side, with a flag to turn them by 90 degrees clockwise."""
    upright = [textured(8 * index) for index in range(4)]
    path = write_clip(tmp_path / "a.mp4", [np.rot90(one) for one in upright], clockwise=True)
    (tmp_path / "out").mkdir()
    found = copy_frames(path, tmp_path / "out", 4)
    assert [photo.size for photo in found.photos] == [(160, 200)] * 4
    for index, one in enumerate(upright):
        assert np.abs(read_rgb(tmp_path / "out" / f"frame_{index:05d}.jpg").astype(int) - one).mean() < 10


@pytest.mark.parametrize(
    ("matrix", "rows"),
    [
        ((1, 0, 0, 1), ["ab", "cd"]),
        ((0, 1, -1, 0), ["ca", "db"]),  # clockwise
        ((-1, 0, 0, -1), ["dc", "ba"]),
        ((0, -1, 1, 0), ["bd", "ac"]),
        ((-1, 0, 0, 1), ["ba", "dc"]),  # left to right
        ((1, 0, 0, -1), ["cd", "ab"]),  # top to bottom
        ((0, 1, 1, 0), ["ac", "bd"]),  # rows are columns
        ((0, -1, -1, 0), ["db", "ca"]),
    ],
)
def test_frames_are_turned_and_mirrored_as_the_matrix_says(
    tmp_path: Path, matrix: tuple[int, int, int, int], rows: list[str]
):
    """Quarters of a stored frame are a and b, and c and d below; x grows to the right, y downwards."""
    bright = {"a": 200, "b": 140, "c": 80, "d": 20}
    grain = np.random.default_rng(0).integers(-20, 21, (160, 200), np.int16)
    grain = cv2.resize(grain[::4, ::4], (200, 160), interpolation=cv2.INTER_NEAREST)
    quarters = np.kron([[200, 140], [80, 20]], np.ones((80, 100)))[..., None]
    stored = [(quarters + np.roll(grain, 8 * step, 1)[..., None]).repeat(3, 2).clip(0, 255) for step in range(4)]
    path = with_matrix(write_clip(tmp_path / "a.mp4", [one.astype(np.uint8) for one in stored]), *matrix)
    (tmp_path / "out").mkdir()
    found = copy_frames(path, tmp_path / "out", 4)
    height, width = found.photos[0].size
    assert (height, width) == ((160, 200) if matrix[0] else (200, 160))
    shown = read_rgb(tmp_path / "out" / found.photos[0].name).mean(-1).reshape(2, height // 2, 2, width // 2)
    np.testing.assert_allclose(shown.mean((1, 3)), [[bright[one] for one in row] for row in rows], atol=5)
    mirrored = matrix[0] * matrix[3] - matrix[1] * matrix[2] < 0
    assert found.notes[1:] == ((MIRRORED,) if mirrored else ())


def wide_again(picture: np.ndarray, width: int, height: int) -> np.ndarray:
    """A picture that is stored with another size and shown with its own."""
    size = (picture.shape[1], picture.shape[0])
    return cv2.resize(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), size).astype(int)


@pytest.mark.parametrize(("width", "height"), [(150, 160), (200, 128)])
def test_frames_whose_pixels_are_not_square_are_stretched(tmp_path: Path, width: int, height: int):
    """Pictures of 200x160 with square pixels, stored narrower or lower."""
    shown = [textured(8 * index) for index in range(4)]
    stored = [cv2.resize(one, (width, height), interpolation=cv2.INTER_AREA) for one in shown]
    path = show_as(write_clip(tmp_path / "a.mp4", stored), 200, 160)
    (tmp_path / "out").mkdir()
    found = copy_frames(path, tmp_path / "out", 4)
    assert [photo.size for photo in found.photos] == [(160, 200)] * 4
    for index, one in enumerate(shown):
        copy = read_rgb(tmp_path / "out" / f"frame_{index:05d}.jpg").astype(int)
        assert copy.shape == one.shape
        assert np.abs(copy - wide_again(one, width, height)).mean() < 10
    assert found.notes[1:] == (
        f"The clip's pixels are not square; its frames were stretched from {width}x{height} to 200x160, as players show them.",
    )


def test_frames_that_are_turned_are_stretched_along_the_axis_they_are_stored_with(tmp_path: Path):
    """Shown with 160x200; stored on their side as 150x160, with pixels of 4:3."""
    upright = [textured(8 * index)[:, :160].copy() for index in range(4)]
    upright = [cv2.resize(one, (160, 200)) for one in upright]
    on_their_side = [cv2.resize(np.rot90(one), (150, 160), interpolation=cv2.INTER_AREA) for one in upright]
    path = show_as(write_clip(tmp_path / "a.mp4", on_their_side, clockwise=True), 200, 160)
    (tmp_path / "out").mkdir()
    found = copy_frames(path, tmp_path / "out", 4)
    assert [photo.size for photo in found.photos] == [(200, 160)] * 4
    for index, one in enumerate(upright):
        copy = read_rgb(tmp_path / "out" / f"frame_{index:05d}.jpg").astype(int)
        assert np.abs(copy - wide_again(one, 160, 150)).mean() < 10
    assert "stretched from 160x150 to 160x200" in found.notes[1]


def test_pixels_that_are_square_but_for_rounding_stay_as_they_are(tmp_path: Path):
    path = show_as(write_clip(tmp_path / "a.mp4", [textured(8 * index) for index in range(4)]), 201, 160)
    (tmp_path / "out").mkdir()
    found = copy_frames(path, tmp_path / "out", 4)
    assert [photo.size for photo in found.photos] == [(160, 200)] * 4
    assert len(found.notes) == 1


def test_pixels_that_stretch_a_clip_too_far_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = show_as(write_clip(tmp_path / "a.mp4", [textured(8 * index) for index in range(4)]), 1000, 160)
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match=r"expected pixels at most 4 times as long as wide, found 5:1$"):
        copy_frames(path, tmp_path / "out", 4)
    monkeypatch.setattr("semgs.sfm.clips.MOST_PIXELS", 300 * 160 - 1)
    with pytest.raises(InputError, match=r"frames of at most 47,999 pixels, found 300x160 with square pixels$"):
        copy_frames(show_as(path, 300, 160), tmp_path / "out", 4)


def test_frames_that_hardly_moved_are_left_out(tmp_path: Path):
    greys = [cv2.cvtColor(textured(shift), cv2.COLOR_RGB2GRAY) for shift in (0, 2, 3, 6, 8)]
    kept = moving([Judged(index, grey, 1.0) for index, grey in enumerate(greys)])
    assert LEAST_MOTION * 200 == 4
    assert [one.index for one in kept] == [0, 3]


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([textured(0)] * 6, "expected a video in which the camera moves, found the same picture in 6 frames"),
        ([np.zeros((160, 200, 3), np.uint8)] * 5, "found 5 black or blank frames"),
    ],
)
def test_a_clip_without_motion_or_light_is_refused(tmp_path: Path, frames: list[np.ndarray], message: str):
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match=message):
        copy_frames(write_clip(tmp_path / "a.mp4", frames), tmp_path / "out", 4)


def test_a_file_that_is_no_video_is_refused(tmp_path: Path):
    (tmp_path / "a.mp4").write_bytes(b"no video")
    with pytest.raises(InputError, match="expected a video in MP4, MOV, AVI, MKV or WebM, found something else"):
        copy_frames(tmp_path / "a.mp4", tmp_path, 4)


def test_photos_that_are_not_damaged_have_a_reason_of_their_own(folder: Path, tmp_path: Path, monkeypatch):
    Image.fromarray(pixels(5)).convert("CMYK").save(folder / "print.jpg")
    save(folder / "large.jpg", pixels(6, HEIGHT, WIDTH + 30))
    (folder / "cut.jpg").write_bytes((folder / "IMG_2.jpg").read_bytes()[:200])
    monkeypatch.setattr("semgs.files.images.pictures.MOST_PIXELS", HEIGHT * WIDTH + 100)
    assert list(copied(folder, tmp_path).notes) == [
        "1 of 5 photos have more than 67 megapixels and are left out; make them smaller, the first is large.jpg.",
        "1 of 5 photos have the colours of printers (CMYK) and are left out; save them as sRGB, the first is print.jpg.",
        "1 of 5 photos are damaged, the first is cut.jpg.",
    ]


def all_around(height: int) -> np.ndarray:
    """A picture twice as wide as high whose left and right ends go together."""
    angle = (np.arange(2 * height) + 0.5) / height * np.pi
    rows = np.linspace(0, 3, height)[:, None]
    waves = [np.sin(k * angle + k + rows) for k in (1, 3, 7)]
    return np.stack([np.uint8(127 + 120 * wave) for wave in waves], axis=-1)


def test_pictures_of_two_to_one_are_panoramas_if_their_ends_go_together():
    assert is_panorama(all_around(80))
    assert not is_panorama(pixels(4, 80, 160))
    assert not is_panorama(all_around(80)[:, :140])  # 1.75 to 1
    assert is_panorama(pixels(4, 80, 170))
    assert is_panorama(pixels(4, 260, 80))
    assert not is_panorama(pixels(4, 160, 80))  # a phone upright


@pytest.mark.parametrize(("height", "width"), [(2400, 1080), (1792, 828), (2340, 1080), (2520, 1080)])
def test_upright_screenshots_of_phones_are_no_panoramas(height: int, width: int):
    assert not is_panorama(pixels(4, height, width))


def test_a_clip_of_panoramas_is_refused(tmp_path: Path):
    clip = write_clip(tmp_path / "a.mp4", [np.roll(all_around(96), 8 * step, axis=1) for step in range(6)])
    (tmp_path / "frames").mkdir()
    with pytest.raises(InputError, match="expected a video of a usual camera, found panoramas"):
        copy_frames(clip, tmp_path / "frames", 6)


def test_the_folders_of_a_camera_are_one_set_of_photos(tmp_path: Path):
    for index, place in enumerate(("100APPLE/IMG_1.jpg", "100APPLE/IMG_2.jpg", "101APPLE/IMG_1.jpg")):
        (tmp_path / "DCIM" / place).parent.mkdir(parents=True, exist_ok=True)
        save(tmp_path / "DCIM" / place, pixels(index))
    assert has_only_photos(tmp_path / "DCIM")
    found = copied(tmp_path / "DCIM", tmp_path)
    assert [photo.name for photo in found.photos] == ["IMG_1.jpg", "IMG_2.jpg", "101APPLE_IMG_1.jpg"]
    np.testing.assert_array_equal(
        read_rgb(tmp_path / "copies/101APPLE_IMG_1.jpg"), read_rgb(tmp_path / "DCIM/101APPLE/IMG_1.jpg")
    )


def test_photos_in_folders_beside_photos_are_counted(folder: Path, tmp_path: Path):
    for name in ("more", "rest"):
        (folder / name).mkdir()
        save(folder / name / "a.jpg", pixels(7))
    assert copied(folder, tmp_path).notes == ("2 photos in folders beside these are not used: more (1), rest (1).",)


def test_photos_in_other_folders_alone_are_not_mixed_and_the_folders_are_named(folder: Path):
    (folder / "bath").mkdir()
    for file in folder.glob("*.jpg"):
        file.rename(folder / "bath" / file.name)
    with pytest.raises(InputError, match=r"found photos only in the folders bath \(2\); name one of these folders"):
        check_folder_of_photos(folder)
    with pytest.raises(InputError, match="semgs poses FOLDER --out OUT estimates them"):
        open_scene(folder)
    shutil.copytree(folder / "bath", folder / "attic")
    with pytest.raises(InputError, match="there are only images, in attic, bath; semgs poses estimates"):
        open_scene(folder)


@pytest.mark.parametrize(
    ("name", "content", "program"),
    [
        ("cameras.xml", b'<?xml version="1.0"?>\n<document version="2.0.0"><chunk label="1">', "Metashape"),
        ("poses_bounds.npy", b"\x93NUMPY\x01\x00", "LLFF"),
        ("sfm_data.json", b'{"sfm_data_version": "0.3"}', "OpenMVG"),
        ("cameras.sfm", b'{"version": ["1"]}', r"AliceVision \(Meshroom\)"),
        ("cameras.csv", b"#name,x,y,alt,yaw,pitch,roll\n", r"RealityScan \(RealityCapture\)"),
        ("bundle.rd.out", b"# Bundle file v0.3\n", "Bundler"),
    ],
)
def test_cameras_of_other_programs_are_mentioned(folder: Path, tmp_path: Path, name: str, content: bytes, program: str):
    (folder / name).write_bytes(content)
    (folder / "notes.csv").write_text("photo,comment\n")
    (folder / "settings.xml").write_text("<settings/>")
    (note,) = copied(folder, tmp_path).notes
    assert re.fullmatch(
        rf"{name} has cameras of {program}, which are not read from here: cameras are estimated anew\.", note
    )


def test_results_splats_and_clips_given_as_scenes_say_what_opens_them(tmp_path: Path):
    for name in ("out/scene.safetensors", "splat.ply", "clip.webm"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    with pytest.raises(InputError, match="this is a result of semgs reconstruct; semgs view, render, query and export"):
        open_scene(tmp_path / "out")
    with pytest.raises(InputError, match="a splat is a result and has no photos; semgs view"):
        open_scene(tmp_path / "splat.ply")
    with pytest.raises(InputError, match="semgs poses CLIP --out OUT estimates them"):
        open_scene(tmp_path / "clip.webm")


def stray_scanner(folder: Path, *others: str) -> Path:
    """A capture of Stray Scanner."""
    for name in ("depth", "confidence", *others):
        (folder / name).mkdir(parents=True)
        Image.fromarray(pixels(1)).save(folder / name / "000000.png")
    for name in ("rgb.mp4", "odometry.csv", "camera_matrix.csv"):
        (folder / name).touch()
    return folder


def test_of_a_capture_of_stray_scanner_the_clip_is_named(tmp_path: Path):
    folder = stray_scanner(tmp_path / "scan")
    told = r"a capture of Stray Scanner, which is not read; semgs poses \S+rgb\.mp4 --out OUT estimates cameras from its clip"
    with pytest.raises(InputError, match=told):
        open_scene(folder)
    with pytest.raises(InputError, match=r"a capture of Stray Scanner, which is not read; give its clip, \S+rgb\.mp4"):
        check_folder_of_photos(folder)


@pytest.mark.parametrize("name", ["depth", "Depth", "depths", "confidence"])
def test_maps_of_depth_and_confidence_are_no_photos(tmp_path: Path, name: str):
    (tmp_path / name).mkdir()
    Image.fromarray(pixels(1)).save(tmp_path / name / "000000.png")
    assert photos_below(tmp_path) == {}
    with pytest.raises(InputError, match=r"data\.md lists the known ones"):
        open_scene(tmp_path)


@pytest.mark.parametrize("ending", [".jfif", ".JFIF", ".jpe"])
def test_jpegs_of_other_endings_are_photos_and_keep_their_bytes(folder: Path, tmp_path: Path, ending: str):
    Image.fromarray(pixels(3)).save(folder / f"IMG_3{ending}", "JPEG", quality=95)
    photos = copied(folder, tmp_path)
    assert [photo.name for photo in photos.photos] == ["IMG_2.jpg", "IMG_3.jpg", "IMG_10.jpg"]
    assert (photos.folder / "IMG_3.jpg").read_bytes() == (folder / f"IMG_3{ending}").read_bytes()


@pytest.mark.parametrize("ending", [".MPO", ".mpo"])
def test_of_photos_with_a_second_picture_the_first_is_read_upright(folder: Path, tmp_path: Path, ending: str):
    """Phones and 3D cameras write MPO: a JPEG behind another."""
    exif = Image.Exif()
    exif[0x112] = 6
    second = [Image.new("RGB", (8, 6))]
    Image.fromarray(pixels(3)).save(folder / f"IMG_3{ending}", "MPO", save_all=True, append_images=second, quality=95)
    Image.fromarray(np.rot90(pixels(4))).save(
        folder / f"IMG_4{ending}", "MPO", save_all=True, append_images=second, exif=exif.tobytes(), quality=95
    )
    photos = copied(folder, tmp_path)
    assert [photo.name for photo in photos.photos] == ["IMG_2.jpg", "IMG_3.jpg", "IMG_4.jpg", "IMG_10.jpg"]
    for name, number in (("IMG_3.jpg", 3), ("IMG_4.jpg", 4)):
        with Image.open(photos.folder / name) as image:
            found = np.asarray(image).astype(int)
        assert found.shape == pixels(number).shape
        assert np.abs(found - pixels(number)).mean() < 8


@pytest.mark.parametrize("ending", [".hif", ".ppm", ".psd"])
def test_photos_of_other_formats_are_counted(folder: Path, tmp_path: Path, ending: str):
    (folder / f"IMG_3{ending}").write_bytes(b"not read")
    assert (
        copied(folder, tmp_path).notes[0]
        == f"1 of 3 photos have a format that is not read ({ending}), the first is IMG_3{ending}."
    )


@pytest.mark.parametrize(
    ("size", "taken"), [((60, 81), False), ((60, 80), True), ((606, 800), True), ((600, 810), False)]
)
def test_one_focal_length_is_for_photos_whose_sizes_differ_by_rounding(
    tmp_path: Path, size: tuple[int, int], taken: bool
):
    """80 and 81 px differ by 1.25 %, 600 and 606 px by 1 %."""
    (tmp_path / "photos").mkdir()
    first = (60, 80) if size[0] < 100 else (600, 800)
    for index, (height, width) in enumerate((first, size)):
        save(tmp_path / "photos" / f"{index}.jpg", pixels(index, height, width))
    found = copied(tmp_path / "photos", tmp_path)
    if taken:
        assert [photo.focal_px for photo in with_focal(found, 70.0)] == [70.0] * 2
    else:
        with pytest.raises(ValueError, match="--focal is for photos of one size"):
            with_focal(found, 70.0)
