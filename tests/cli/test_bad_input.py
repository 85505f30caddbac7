"""Whatever is wrong with the input: exit code 2, one line on stderr (a list after it if no layout is known), and nothing is changed on disk."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from networks import preset

from semgs.cli.main import main, run_guarded
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.folders import own_folder
from semgs.model import networks
from semgs.model.build import build
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import save

Refused = Callable[..., str]


def tree(folder: Path) -> dict[str, bytes | None]:
    return {str(path): path.read_bytes() if path.is_file() else None for path in sorted(folder.rglob("*"))}


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Refused:
    """Runs `semgs reconstruct SCENE --out DIR ...`, checks that it is refused well, and returns the line."""

    def run(scene: Path, *options: str, out: Path | None = None) -> str:
        before = tree(tmp_path)
        arguments = ["reconstruct", str(scene), "--out", str(out or tmp_path / "out"), *options]
        if "--weights" not in options:
            arguments += ["--weights", "random"]
        capsys.readouterr()
        assert main(arguments) == 2
        told = capsys.readouterr()
        assert told.out == ""
        assert told.err.startswith("semgs: error: ")
        assert told.err.count("\n") == 1
        assert tree(tmp_path) == before
        return told.err

    return run


def test_a_missing_folder(refused: Refused, tmp_path: Path) -> None:
    assert "nothing there" in refused(tmp_path / "nowhere")


def test_a_folder_of_no_known_layout(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    told = refused(tmp_path / "empty")
    assert told.endswith("empty: expected a scene, found no known layout; the folder is empty\n")


def test_a_scene_without_its_transforms_file(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its images are taken as photos without poses, and these say too little."""
    (scene / "transforms.json").unlink()
    before = tree(tmp_path)
    assert main(["reconstruct", str(scene), "--out", str(tmp_path / "out"), "--weights", "random"]) == 2
    told = capsys.readouterr()
    assert told.out == "Estimating the cameras of 4 photos: about 1 s\n"
    assert "too little detail in them (4 photos)" in told.err
    assert told.err.count("\n") == 1
    assert tree(tmp_path) == before


def test_another_number_of_views_than_of_named_frames_is_refused(refused: Refused, scene: Path) -> None:
    """Two frames were used then, and a note said that more than 4 views may blur."""
    assert "--views is 6 and --context names 2 frames; leave one out" in refused(
        scene, "--context", "0", "2", "--views", "6"
    )


def test_options_for_photos_are_refused_for_scenes(refused: Refused, scene: Path) -> None:
    assert "--focal, --scale-from and --clip-frames are for photos without poses" in refused(scene, "--focal", "60")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a.png", "b.png"], "expected two photos and a distance in metres, found 'a.png b.png'"),
        (["a.png b.png far"], "expected a distance in metres after two photos, found 'far'"),
        (["a.png", "b.png", "0"], "the distance is 0 m; expected more than 0"),
    ],
)
def test_a_scale_that_is_no_distance(refused: Refused, scene: Path, words: list[str], said: str) -> None:
    (scene / "transforms.json").unlink()
    assert said in refused(scene, "--scale-from", *words)


def test_bounds_of_photos_without_cameras_have_no_unit(refused: Refused, scene: Path) -> None:
    (scene / "transforms.json").unlink()
    assert "--depth-range is for cameras whose unit is known; add --scale-from" in refused(
        scene, "--depth-range", "0.25", "5"
    )


@pytest.mark.parametrize("text", ["", "{", "[]", '{"frames": 3}', '{"frames": []}', "\x00\xff"])
def test_a_broken_transforms_file(refused: Refused, scene: Path, text: str) -> None:
    (scene / "transforms.json").write_bytes(text.encode("latin-1"))
    assert "transforms.json" in refused(scene)


def test_poses_that_are_not_numbers(refused: Refused, broken: Callable[..., Path]) -> None:
    """All of them: single ones are left out."""

    def lose(scene: dict) -> None:
        for frame in scene["frames"]:
            frame["transform_matrix"][0][3] = float("nan")

    assert "transform_matrix" in refused(broken(lose))


def test_a_singular_pose(refused: Refused, broken: Callable[..., Path]) -> None:
    assert "transform_matrix" in refused(
        broken(lambda scene: scene["frames"][1].update(transform_matrix=[[0, 0, 0, 1]] * 3 + [[0, 0, 0, 1]]))
    )


def test_one_view_only(refused: Refused, broken: Callable[..., Path]) -> None:
    assert "at least two usable frames" in refused(broken(frames=1))


@pytest.mark.parametrize("focal", [0, -60.0])
def test_a_focal_length_that_is_not_positive(refused: Refused, broken: Callable[..., Path], focal: float) -> None:
    assert "fl_x" in refused(broken(lambda scene: scene.update(fl_x=focal)))


def test_pictures_of_another_size_than_their_camera(refused: Refused, broken: Callable[..., Path]) -> None:
    assert "100x90" in refused(broken(lambda scene: scene.update(w=100, h=90)))


@pytest.mark.parametrize("kept", [0, 20, 400])
def test_a_picture_cut_short(refused: Refused, scene: Path, kept: int) -> None:
    for picture in (scene / "images").iterdir():
        picture.write_bytes(picture.read_bytes()[:kept])
    assert ".png" in refused(scene)


def test_pictures_that_are_missing(refused: Refused, scene: Path) -> None:
    for picture in sorted((scene / "images").iterdir())[1:]:
        picture.unlink()
    assert "3 without their image" in refused(scene)


@pytest.mark.parametrize("views", ["0", "1", "-3", "1000", "two", "2.5", "9" * 40])
def test_an_absurd_number_of_views(refused: Refused, scene: Path, views: str) -> None:
    assert "views" in refused(scene, "--views", views)


@pytest.mark.parametrize("context", [["1"], ["0", "99"], ["0", "0"], ["-1", "2"], ["0", "nobody.png"]])
def test_context_frames_that_cannot_be(refused: Refused, scene: Path, context: list[str]) -> None:
    refused(scene, "--context", *context)


@pytest.mark.parametrize("size", ["0x0", "240", "axb", "-1x20", "99999x99999", "240x320x3", "8x8"])
def test_a_size_that_cannot_be(refused: Refused, scene: Path, size: str) -> None:
    assert "--size" in refused(scene, "--size", size)


@pytest.mark.parametrize("device", ["mps", "tpu", ""])
def test_a_device_that_cannot_be(refused: Refused, scene: Path, device: str) -> None:
    assert "--device" in refused(scene, "--device", device)


def test_cuda_where_there_is_none(refused: Refused, scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert "no CUDA device" in refused(scene, "--device", "cuda")


def test_a_model_that_does_not_exist_or_has_no_weights(refused: Refused, scene: Path) -> None:
    assert "--model" in refused(scene, "--model", "huge")
    assert "there are no included weights" in refused(scene, "--weights", "mvsplat")


def test_weights_that_are_missing_damaged_or_of_something_else(refused: Refused, scene: Path, tmp_path: Path) -> None:
    assert "nothing there" in refused(scene, "--weights", str(tmp_path / "nowhere.safetensors"))
    (tmp_path / "text").write_text("weights, honestly")
    assert "text" in refused(scene, "--weights", str(tmp_path / "text"))
    save(tmp_path / "good", load("small", "random"), {})
    (tmp_path / "cut").write_bytes((tmp_path / "good").read_bytes()[:5000])
    assert "cut" in refused(scene, "--weights", str(tmp_path / "cut"))
    assert '"small"' in refused(scene, "--weights", str(tmp_path / "good"), "--model", "base")


def test_weights_of_another_class_table(refused: Refused, scene: Path, tmp_path: Path) -> None:
    table = ClassTable("two", ("a", "b"), ((1, 2, 3), (4, 5, 6)), (1, 2))
    save(tmp_path / "two.safetensors", build(networks.small(), table), {})
    line = refused(scene, "--weights", str(tmp_path / "two.safetensors"))
    assert "two" in line
    assert SCANNET20.name in line


def test_weights_of_another_shape(refused: Refused, scene: Path, tmp_path: Path) -> None:
    model = preset("small")
    colour = model.settings.colour
    model.settings = replace(model.settings, colour=replace(colour, depth=replace(colour.depth, candidates=32)))
    save(tmp_path / "odd.safetensors", model, {})
    assert "shape" in refused(scene, "--weights", str(tmp_path / "odd.safetensors"))


def test_an_output_folder_that_is_not_ours(refused: Refused, scene: Path, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.txt").write_text("mine")
    assert "mark .semgs" in refused(scene, out=tmp_path / "photos")
    assert "mark .semgs" in refused(scene, "--overwrite", out=tmp_path / "photos")
    assert "mark .semgs" in refused(scene, "--overwrite", out=scene)
    assert "found a file" in refused(scene, out=tmp_path / "photos" / "a.txt")


def test_a_folder_of_ours_without_overwrite(refused: Refused, scene: Path, tmp_path: Path) -> None:
    with own_folder(tmp_path / "out", "reconstruct") as folder:
        (folder / "report.json").write_text("{}")
    assert "--overwrite" in refused(scene)


@pytest.mark.parametrize("full_at", ["scene.safetensors", "report.html", ""])
def test_a_full_disk(
    refused: Refused, scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, full_at: str
) -> None:
    with own_folder(tmp_path / "out", "reconstruct") as folder:
        (folder / "report.json").write_text("{}")
    replace = Path.replace

    def full(path: Path, target: Path) -> Path:
        if (target.name == full_at) if full_at else (path.name.startswith(".out.") and path.suffix == ".part"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", full)
    monkeypatch.setattr(
        "semgs.files.folders._exchange", lambda first, second: False
    )  # so that the folder is renamed too
    assert "the disk is full" in refused(scene, "--overwrite")


def test_unknown_commands_and_options(refused: Refused, scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "--viws" in refused(scene, "--viws", "3")
    assert main(["recontruct", str(scene)]) == 2
    assert "did you mean reconstruct?" in (told := capsys.readouterr().err)
    assert "expected one of demo, reconstruct" in told
    assert main(["xyz", str(scene)]) == 2
    assert "expected one of demo, reconstruct" in capsys.readouterr().err
    assert main(["reconstruct", str(scene)]) == 2
    told = capsys.readouterr().err
    assert "--out" in told
    assert told.count("\n") == 1


def test_a_fault_of_ours_keeps_its_traceback_and_leaves_nothing(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fault(*_: object) -> None:
        raise ValueError("a fault of ours")

    monkeypatch.setattr("semgs.run.output.files.save_ply", fault)
    with pytest.raises(ValueError, match="a fault of ours"):
        main(["reconstruct", str(scene), "--out", str(tmp_path / "out"), "--weights", "random"])
    assert [path.name for path in tmp_path.iterdir()] == ["scene"]


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_leaves_nothing_behind(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sent: signal.Signals, code: int
) -> None:
    # What a shell starts in the background is deaf to Ctrl-C, and these tests may be among it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr("semgs.run.output.files.save_ply", lambda *_: os.kill(os.getpid(), sent))
    try:
        ended = main(["reconstruct", str(scene), "--out", str(tmp_path / "out"), "--weights", "random"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended == code
    assert [path.name for path in tmp_path.iterdir()] == ["scene"]


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_that_a_library_turns_into_another_exception_is_one(sent: signal.Signals, code: int) -> None:
    """As safetensors does."""

    def work() -> int:
        try:
            os.kill(os.getpid(), sent)
        except BaseException as error:
            raise ValueError("could not determine the shape") from error
        return 0

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert run_guarded(work) == code
    finally:
        signal.signal(signal.SIGINT, before)


def run_process(*arguments: str) -> subprocess.CompletedProcess[str]:
    program = (
        "import sys; from semgs.cli.main import main; code = main(sys.argv[1:]); "
        "print('torch' if 'torch' in sys.modules else 'no torch'); sys.exit(code)"
    )
    return subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, timeout=280, check=False
    )


def test_a_missing_folder_is_told_without_importing_torch(tmp_path: Path) -> None:
    done = run_process("reconstruct", str(tmp_path / "nowhere"), "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert done.stdout == "no torch\n"
    assert done.stderr.startswith("semgs: error: ")
    assert done.stderr.count("\n") == 1


def test_a_process_with_a_broken_scene_ends_with_one_line_and_no_traceback(broken: Callable[..., Path]) -> None:
    folder = broken(lambda scene: scene.update(fl_x=0))
    done = run_process("reconstruct", str(folder), "--out", str(folder.parent / "out"), "--weights", "random")
    assert done.returncode == 2
    assert done.stderr.startswith("semgs: error: ")
    assert done.stderr.count("\n") == 1
    assert [path.name for path in folder.parent.iterdir()] == ["scene"]


def test_a_reader_that_has_gone_ends_a_command_without_a_traceback() -> None:
    reads, writes = os.pipe()
    os.close(reads)
    program = "import sys; from semgs.cli.main import main; sys.exit(main(['--help']))"
    done = subprocess.run(
        [sys.executable, "-c", program], stdout=writes, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(writes)
    assert (done.returncode, done.stderr) == (141, "")
