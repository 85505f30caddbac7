"""The worker of `semgs app`: imports what takes seconds, waits for a request on stdin, does it, and ends.

A request is done by the same commands as on the command line: `semgs reconstruct`, then `semgs export`.
"""

from __future__ import annotations

import io
import json
import os
import sys
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from semgs.cli.main import main, run_guarded
from semgs.cli.progress import VARIABLE, report_stage
from semgs.cli.usage_errors import UsageError
from semgs.data.confined import confine_to
from semgs.files.cache import VARIABLE as VARIABLE_OF_CACHE
from semgs.files.strict_json import read_json
from semgs.runtime.threads import adapt_threads, prepare_threads


def import_slow_modules() -> None:
    """Import what a reconstruction needs, before there is one to do."""
    import semgs.app.room
    import semgs.cli.commands.scenes.export
    import semgs.cli.commands.scenes.photo_scene
    import semgs.cli.commands.scenes.reconstruct
    import semgs.data.scenes
    import semgs.doctor.quick
    import semgs.export.scene_export
    import semgs.model.weights.load
    import semgs.reconstruction.output.files
    import semgs.reconstruction.pipeline
    import semgs.sfm.scene_folder
    import semgs.viewer.viewer_page  # noqa: F401
    from semgs.robotics.object_libraries import check_object_libraries
    from semgs.sfm.pycolmap_library import pycolmap
    from semgs.viewer.server import check_viewer_library

    check_viewer_library()
    with suppress(ImportError):
        check_object_libraries()
    with suppress(ImportError):
        pycolmap()  # scenes with cameras need no pycolmap; photos say what is missing


def warm_up() -> None:
    """Reconstruct the included room in small, so that kernels and libraries are loaded before there is a request."""
    from semgs.data.demo_scene import demo_scene

    progress = os.environ.pop(VARIABLE, None)
    with TemporaryDirectory(prefix="semgs-") as folder, redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        main(["reconstruct", str(demo_scene()), "--out", f"{folder}/out", "--size", "64x96"])
    if progress is not None:
        os.environ[VARIABLE] = progress


def work(line: str) -> int:
    """Do a request. Returns the exit code.

    Args:
        line: the request, JSON.

    Raises:
        UsageError: the files of the request cannot be used.
    """
    from semgs.app.limits import Limits
    from semgs.app.requests import Request, RoomOptions
    from semgs.app.room import write_room
    from semgs.app.uploads import UNPACKED, Prepared, UnusableUploadError, Upload, prepare

    report_stage("Getting ready")  # the queue takes this as the beginning
    request = Request(**json.loads(line))
    options = RoomOptions(**request.options)
    folder = Path(request.folder)
    work_folder = folder / "work"
    work_folder.mkdir()
    # Relative paths, so that reports and messages name what a user gave, and no folder of this machine.
    os.chdir(work_folder)
    out, extra = Path("out"), Path("files")
    if request.kind == "example":
        from semgs.data.demo_scene import demo_scene

        prepared, arguments = Prepared(Path("included_room")), options.arguments({})
        prepared.scene.symlink_to(demo_scene())
    else:
        confine_to(Path())
        os.environ[VARIABLE_OF_CACHE] = str(
            work_folder / "cache"
        )  # nothing of a user's scene stays when its job is deleted
        uploads = [Upload(Path(path), name) for path, name in request.files]
        try:
            prepared = prepare(request.kind, uploads, Path(), Limits(**request.limits), report_stage)
            arguments = options.arguments(prepared.photos)
        except UnusableUploadError as error:
            raise UsageError(str(error)) from error
        if prepared.scene.is_relative_to(UNPACKED):
            confine_to(Path(UNPACKED))
    # A room has copies of the views that it shows, and no other photo.
    code = main(["reconstruct", str(prepared.scene), "--out", str(out), "--drop-photos", *arguments])
    if code:
        return code
    report: Any = read_json(out / "report.json")
    metric = report["scene"]["unit"] == "metric"
    formats = ["points", "gltf", *(["objects"] if metric else [])]
    report_stage("Writing files to download")
    code = main(["export", str(out), "--out", str(extra), "--as", *formats])
    if code:
        return code
    for path in extra.iterdir():
        if path.name != "export.json" and not path.name.startswith("."):
            path.rename(out / path.name)
    report_stage("Making the page of your room")
    titles = {"photos": "Your room", "clip": "Your room", "archive": "Your scene", "example": "The included room"}
    write_room(out, title=titles[request.kind], notes=prepared.notes)
    out.rename(folder / "room")
    return 0


def speak_alone() -> None:
    """Keep stderr to Python: libraries for pictures print what is in a user's files there, which the queue would take for messages."""
    own = os.dup(2)
    with Path(os.devnull).open("w") as nothing:
        os.dup2(nothing.fileno(), 2)
    sys.stderr = os.fdopen(own, "w", buffering=1, encoding="utf-8", errors="backslashreplace")


def serve() -> int:
    """Wait for one request and do it. Returns the exit code."""
    prepare_threads()
    import_slow_modules()
    if "--cold" not in sys.argv:
        warm_up()
    line = sys.stdin.readline()
    adapt_threads()  # from here on, what counts is how busy the machine is during this request
    return work(line) if line else 0


if __name__ == "__main__":
    speak_alone()
    sys.exit(run_guarded(serve))
