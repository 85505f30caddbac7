"""The worker of `semgs app`: imports what takes seconds, waits for a request on stdin, does it, and ends.

On stderr it writes a line of JSON for each stage ({"stage": title, "done": 2, "of": 8}), and for a request that cannot be done ({"refused": sentence}).
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from semgs.app.requests import OWN, Request, RoomOptions
from semgs.data.confined import confine_to
from semgs.files.paths import VARIABLE as VARIABLE_OF_CACHE
from semgs.files.strict_json import read_json
from semgs.files.text import shortened
from semgs.run.reconstruct import Reconstruct
from semgs.run.usage_errors import BAD_INPUT
from semgs.runtime.cores import adapt_threads, prepare_threads
from semgs.runtime.notes import Note, Progress, for_page

if TYPE_CHECKING:
    from semgs.app.uploads import Prepared

LONGEST = 1500
"""Letters of a sentence for the queue, which reads no longer lines than a few thousand bytes."""

TITLES = {"photos": "Your room", "clip": "Your room", "archive": "Your scene", "example": "The included room"}


class ToQueue(Progress):
    """Tells the queue which stage a job has reached."""

    @contextmanager
    def stage(self, title: str) -> Iterator[None]:
        """Send the title of a stage."""
        _tell(title)
        yield

    @contextmanager
    def steps(self, title: str, count: int) -> Iterator[Callable[[int], None]]:
        """Send the title of a stage, and how far it is."""
        _tell(title, done=0, of=count)
        yield lambda steps: _tell(title, done=steps, of=count)

    def announce(self, line: str) -> None:
        """Send a line as a stage."""
        _tell(line)

    def compiling(self) -> None:
        """Say that kernels are compiled."""
        _tell("Compiling, once on this machine")


def _tell(title: str, **counts: int) -> None:
    """Send a stage to the queue, in words for the page."""
    _send({"stage": title.on_page if isinstance(title, Note) else title, **counts})


def _send(message: dict[str, Any]) -> None:
    """Send a message to the queue."""
    print(json.dumps(message), file=sys.stderr, flush=True)


def import_slow_modules() -> None:
    """Import what a reconstruction needs, before there is one to do."""
    import semgs.app.room
    import semgs.data.scenes
    import semgs.doctor.quick
    import semgs.export.scene_export
    import semgs.model.weights.load
    import semgs.run.export
    import semgs.run.output.files
    import semgs.run.photo_scene
    import semgs.run.steps.pipeline
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

    with TemporaryDirectory(prefix="semgs-") as folder:
        Reconstruct(scene=demo_scene(), out=Path(folder) / "out", size=(64, 96)).run(Progress())


def work(line: str) -> int:
    """Do a request. Returns the exit code.

    Args:
        line: the request, JSON.
    """
    from semgs.app.requests import page_error

    progress = ToQueue()
    progress.announce("Getting ready")  # the queue takes this as the beginning
    request = Request(**json.loads(line))
    try:
        make_room(request, progress)
    except Exception as error:
        sentence = page_error(error, request)
        if sentence is None:  # a bug of ours
            raise
        _send({"refused": shortened(sentence, LONGEST)})
        return BAD_INPUT
    return 0


def make_room(request: Request, progress: Progress) -> None:
    """Reconstruct what was uploaded, and make its page in the folder `room` of the job.

    Raises:
        UnusableUploadError: the uploads, or the options with them, cannot be used.
        InputError, UsageError: as `Reconstruct.run` and `Export.run`.
    """
    from semgs.app.room import write_room
    from semgs.run.export import Export, Format

    folder = Path(request.folder)
    work_folder = folder / "work"
    work_folder.mkdir()
    # Relative paths, so that reports and messages name what a user gave, and no folder of this machine.
    os.chdir(work_folder)
    out, extra = Path("out"), Path("files")
    prepared = _prepared(request, work_folder, progress)
    made = room_run(RoomOptions(**request.options), prepared, out).run(progress)
    metric = read_json(out / "report.json")["scene"]["unit"] == "metric"
    formats: tuple[Format, ...] = ("points", "gltf", "objects") if metric else ("points", "gltf")
    with progress.stage("Writing files to download"):
        Export(scene=out, out=extra, formats=formats).run(Progress())
    for path in extra.iterdir():
        if path.name != "export.json" and not path.name.startswith("."):
            path.rename(out / path.name)
    with progress.stage("Making the page of your room"):
        write_room(out, title=TITLES[request.kind], notes=[*prepared.notes, *for_page(made.notes)])
    out.rename(folder / "room")


def _prepared(request: Request, work_folder: Path, progress: Progress) -> Prepared:
    """What was uploaded as a scene in the working folder. From here on, this process reads nothing outside of it.

    Raises:
        UnusableUploadError: it cannot be used.
    """
    from semgs.app.limits import Limits
    from semgs.app.uploads import UNPACKED, Prepared, Upload, prepare

    if request.kind == "example":
        from semgs.data.demo_scene import demo_scene

        example = Prepared(Path("included_room"))
        example.scene.symlink_to(demo_scene())
        return example
    confine_to(Path())
    # Nothing of a user's scene stays when its job is deleted.
    os.environ[VARIABLE_OF_CACHE] = str(work_folder / "cache")
    uploads = [Upload(Path(path), name) for path, name in request.files]
    prepared = prepare(request.kind, uploads, Path(), Limits(**request.limits), progress.announce)
    if prepared.scene.is_relative_to(UNPACKED):
        confine_to(Path(UNPACKED))
    return prepared


def room_run(options: RoomOptions, prepared: Prepared, out: Path) -> Reconstruct:
    """The reconstruction of a room with the options that the user chose.

    Raises:
        UnusableUploadError: a photo that gives the scale cannot be used.
    """
    from semgs.run.options.depth_options import DepthOptions
    from semgs.run.options.scene_options import PosingOptions
    from semgs.run.options.segmenter_options import AnswerOptions, SegmenterOptions

    own = options.segmenter == OWN
    words = () if own else tuple(word.strip() for word in options.words.split(",") if word.strip())
    return Reconstruct(
        scene=prepared.scene,
        out=out,
        views=options.views or None,
        refine=-1 if options.refine else 0,
        drop_photos=True,  # a room has copies of the views that it shows, and no other photo
        segmenting=SegmenterOptions(segmenter=None if own else options.segmenter, answers=AnswerOptions(words=words)),
        placing=DepthOptions(depth=options.depth),
        posing=PosingOptions(scale_from=options.scale_from(prepared.photos)),
    )


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
    sys.exit(serve())
