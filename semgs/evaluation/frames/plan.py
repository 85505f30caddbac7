"""The plan of an evaluation: every target with its contexts and its size, in memory and, by frame names, in a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from semgs.data.scene import Scene
from semgs.evaluation.frames.protocols import Sample
from semgs.files.errors import InputError
from semgs.files.strict_json import read_json
from semgs.files.text import listed

LANDSCAPE = (240, 320)
"""(height, width) that the field compares at [px]; portrait scenes have it turned."""

FORMAT = "semgs.frames"
VERSION = 1

Protocol = Callable[[Scene, int], list[Sample]]
"""From a scene and a number of views to its samples."""


@dataclass(frozen=True, eq=False)
class Task:
    """One target to draw and score.

    Attributes:
        scene: that it is in.
        size: (height, width) at which all frames are read and compared [px].
        sample: the target and its contexts.
    """

    scene: Scene
    size: tuple[int, int]
    sample: Sample

    @property
    def views(self) -> int:
        """The number of contexts."""
        return len(self.sample.contexts)

    @property
    def target(self) -> str:
        """The name of the target's frame."""
        return self.scene.frames[self.sample.target].name

    @property
    def contexts(self) -> tuple[str, ...]:
        """The names of the contexts' frames."""
        return tuple(self.scene.frames[index].name for index in self.sample.contexts)

    def __str__(self) -> str:
        return self.stem

    @property
    def stem(self) -> str:
        """Where the files of this target are below a folder of predictions: "N2/living/0001"."""
        return f"N{self.views}/{self.truth_stem}"

    @property
    def truth_stem(self) -> str:
        """As `stem`, without the number of views, on which the truth does not depend."""
        return f"{self.scene.name}/{Path(self.target).stem}"


@dataclass(frozen=True, eq=False)
class Plan:
    """All targets of an evaluation.

    Attributes:
        protocol: what chose them, in words ("neighbours").
        tasks: by number of views, then scene, then frame.
        depth_range: near and far given to a method, in the scenes' unit; None is what each scene knows.
    """

    protocol: str
    tasks: tuple[Task, ...]
    depth_range: tuple[float, float] | None = None

    @property
    def views(self) -> tuple[int, ...]:
        """The numbers of views, ascending."""
        return tuple(sorted({task.views for task in self.tasks}))

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The scenes, in order."""
        return tuple({task.scene.name: task.scene for task in self.tasks}.values())

    def of(self, views: int) -> tuple[Task, ...]:
        """The tasks with that many contexts."""
        return tuple(task for task in self.tasks if task.views == views)


def make_plan(
    name: str, protocol: Protocol, scenes: Sequence[Scene], views: Sequence[int], size: tuple[int, int] | None = None
) -> Plan:
    """The plan of a protocol over scenes.

    Args:
        name: of the protocol, to be told.
        protocol: from a scene to its samples.
        scenes: to evaluate on, of different names.
        views: numbers of contexts.
        size: (height, width) of all scenes [px]; None is 240x320, turned where most frames of a scene are portrait.

    Raises:
        InputError: a scene is too small, or two of its targets would have files of the same name.
    """
    tasks = [
        Task(scene, size or usual_size(scene), sample)
        for count in sorted(set(views))
        for scene in scenes
        for sample in protocol(scene, count)
    ]
    return _checked(Plan(name, tuple(tasks)))


def with_depth_range(plan: Plan, depth_range: tuple[float, float] | None) -> Plan:
    """The plan with near and far for all scenes, which is told with the protocol; None leaves it as it is."""
    if depth_range is None:
        return plan
    near, far = depth_range
    return replace(plan, protocol=f"{plan.protocol}, near {near:g} and far {far:g}", depth_range=depth_range)


def usual_size(scene: Scene) -> tuple[int, int]:
    """240x320, or 320x240 where most frames of the scene are taller than wide."""
    portrait = sum(frame.lens.size[0] > frame.lens.size[1] for frame in scene.frames)
    return LANDSCAPE[::-1] if 2 * portrait > len(scene) else LANDSCAPE


def frame_list(plan: Plan) -> dict:
    """The plan by names, ready for JSON: what `pinned_plan` reads."""
    scenes = [
        {
            "scene": scene.name,
            "size": list(next(task.size for task in plan.tasks if task.scene is scene)),
            "samples": [
                {"target": task.target, "contexts": list(task.contexts)} for task in plan.tasks if task.scene is scene
            ],
        }
        for scene in plan.scenes
    ]
    return {"format": FORMAT, "version": VERSION, "protocol": plan.protocol, "scenes": scenes}


def pinned_plan(
    path: str | Path, scenes: Sequence[Scene], views: Sequence[int] = (), size: tuple[int, int] | None = None
) -> Plan:
    """The plan that a file holds: `frames.json` or `report.json` of an evaluation, or one written by hand.

    Args:
        path: of the file.
        scenes: at least those that the file names.
        views: numbers of contexts to take from it; none takes all.
        size: (height, width) instead of the file's [px].

    Raises:
        InputError: the file cannot be read, is of another format, names a scene or frame that is not there, gives a target
            no two contexts or itself among them, or has no sample of one of the numbers of views.
    """
    content = _frames_of(Path(path))
    known = {scene.name: scene for scene in scenes}
    tasks = []
    for number, entry in enumerate(_list(path, content, "scenes", "frames")):
        place = f"scenes[{number}]"
        name = entry.get("scene") if isinstance(entry, dict) else None
        if name not in known:
            raise InputError(path, f"one of the scenes {listed(list(known))}", f"{name!r}", key=f"{place}.scene")
        pinned = _size(path, entry.get("size"), f"{place}.size")
        for index, sample in enumerate(_list(path, entry, "samples", place)):
            one = _sample(path, known[name], sample, f"{place}.samples[{index}]")
            tasks.append(Task(known[name], size or pinned or usual_size(known[name]), one))
    held = sorted({task.views for task in tasks})
    for count in views:
        if count not in held:
            raise InputError(path, f"samples of {count} views", f"of {', '.join(map(str, held)) or 'none'} only")
    kept = [task for task in tasks if not views or task.views in views]
    order = {scene.name: number for number, scene in enumerate(scenes)}
    kept.sort(key=lambda task: (task.views, order[task.scene.name]))  # stable: samples stay as they are listed
    return _checked(Plan(f"pinned: {content.get('protocol', 'by hand')}", tuple(kept)))


def _frames_of(path: Path) -> dict:
    """The list of frames in a JSON file.

    Raises:
        InputError: it cannot be read, or is none.
    """
    content = read_json(path, "a JSON file of frames")
    if isinstance(content, dict) and isinstance(content.get("frames"), dict):
        content = content["frames"]  # of a report
    if not isinstance(content, dict) or (content.get("format"), content.get("version")) != (FORMAT, VERSION):
        raise InputError(path, f"format {FORMAT!r}, version {VERSION}", "something else", key="format")
    return content


def _list(path: str | Path, holder: dict, key: str, place: str) -> list:
    """The list under a key.

    Raises:
        InputError: there is none, or it is empty.
    """
    found = holder.get(key)
    if not isinstance(found, list) or not found:
        raise InputError(path, "a list", f"{found!r:.40}", key=f"{place}.{key}")
    return found


def _size(path: str | Path, value: object, place: str) -> tuple[int, int] | None:
    """(height, width), None where none is given.

    Raises:
        InputError: it is not two positive integers.
    """
    if value is None:
        return None
    if isinstance(value, list) and len(value) == 2 and all(type(side) is int and side > 0 for side in value):
        return value[0], value[1]
    raise InputError(path, "height and width", f"{value!r:.40}", key=place)


def _sample(path: str | Path, scene: Scene, entry: object, place: str) -> Sample:
    """The sample that names stand for.

    Raises:
        InputError: a name is no frame of the scene, comes twice, or there are fewer than two contexts.
    """
    held = entry if isinstance(entry, dict) else {}
    contexts = held.get("contexts")
    listed = [held.get("target"), *(contexts if isinstance(contexts, list) else [])]
    names = [name for name in listed if isinstance(name, str)]
    if len(names) < 3 or len(names) < len(listed):
        raise InputError(path, "a target and two or more contexts, by name", f"{entry!r:.60}", key=place)
    try:
        positions = [scene.index(name) for name in names]
    except ValueError as error:
        raise InputError(path, f"frames of {scene.name}", str(error), key=place) from error
    if len(set(positions)) != len(positions):
        raise InputError(path, "different frames", ", ".join(names), key=place)
    return Sample(tuple(positions[1:]), positions[0])


def _checked(plan: Plan) -> Plan:
    """The plan, if each of its targets has files of its own.

    Raises:
        InputError: two targets of a scene have the same file name, or one is listed twice.
    """
    stems: dict[str, Task] = {}
    for task in plan.tasks:
        if task.stem in stems:
            raise InputError(
                task.scene.path, "targets whose file names differ", f"{stems[task.stem].target} and {task.target}"
            )
        stems[task.stem] = task
    return plan
