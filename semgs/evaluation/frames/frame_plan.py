"""The plan of an evaluation: every target with its contexts and its size, in memory and, by frame name, in a file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.evaluation.frames.protocols import TargetSample, kind_aside
from semgs.files.errors import InputError, input_error
from semgs.files.strict_json import read_json
from semgs.files.text import listed

LANDSCAPE = (240, 320)
"""(height, width) at which other papers evaluate [px]; swapped for portrait scenes."""

FORMAT = "semgs.frames"
VERSION = 1

Protocol = Callable[[Scene, int], list[TargetSample]]
"""A function from a scene and a number of views to samples."""


@dataclass(frozen=True, eq=False)
class Task:
    """One target to predict and score.

    Attributes:
        scene: of the target.
        size: (height, width) at which all frames are read and compared [px].
        sample: the target and its contexts.
        fit: what is done with images of another aspect than `size`.
        file_name: of this target's files, without ending; None for that of its image.
    """

    scene: Scene
    size: tuple[int, int]
    sample: TargetSample
    fit: Fit = "stretch"
    file_name: str | None = None

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

    @property
    def others(self) -> tuple[str, ...]:
        """The names of the other input frames."""
        return tuple(self.scene.frames[index].name for index in self.sample.others)

    def from_others(self) -> Task:
        """The same target from the other input frames."""
        return replace(self, sample=TargetSample(self.sample.others, self.sample.target))

    @property
    def kind(self) -> str:
        """How far the target is aside of the input views, such as "20 cm"; empty for other targets."""
        return kind_aside(self.target)

    def __str__(self) -> str:
        return self.stem

    @property
    def stem(self) -> str:
        """Path of this target's files inside a predictions folder, without ending: "N2/living/0001"."""
        return f"N{self.views}/{self.truth_stem}"

    @property
    def truth_stem(self) -> str:
        """Like `stem`, but without the number of views: the truth does not depend on it."""
        return f"{self.scene.name}/{self.file_name or Path(self.target).stem}"


@dataclass(frozen=True, eq=False)
class FramePlan:
    """All targets of an evaluation.

    Attributes:
        protocol: how the targets were chosen, in words ("neighbours").
        tasks: sorted by number of views, then scene, then frame.
        depth_range: near and far given to the method, in the scenes' unit; None uses the bounds of each scene.
    """

    protocol: str
    tasks: tuple[Task, ...]
    depth_range: tuple[float, float] | None = None

    @property
    def title(self) -> str:
        """The protocol, with near and far if they are not those of each scene."""
        if self.depth_range is None:
            return self.protocol
        near, far = self.depth_range
        return f"{self.protocol}, near {near:g} and far {far:g}"

    @property
    def views(self) -> tuple[int, ...]:
        """The numbers of views, ascending."""
        return tuple(sorted({task.views for task in self.tasks}))

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The scenes, in order."""
        return tuple({task.scene.name: task.scene for task in self.tasks}.values())

    def of(self, views: int) -> tuple[Task, ...]:
        """The tasks with this number of contexts."""
        return tuple(task for task in self.tasks if task.views == views)


def make_plan(
    name: str,
    protocol: Protocol,
    scenes: Sequence[Scene],
    views: Sequence[int],
    size: tuple[int, int] | None = None,
    fit: Fit = "stretch",
) -> FramePlan:
    """The plan of a protocol on some scenes.

    Args:
        name: of the protocol, for reports.
        protocol: from a scene to its samples.
        scenes: to evaluate on, of different names.
        views: numbers of contexts.
        size: (height, width) of all scenes [px]; None is 240x320, swapped for scenes with mostly portrait frames.
        fit: what is done with images of another aspect.

    Raises:
        InputError: a scene has too few frames, or has a target twice.
    """
    tasks = [
        Task(scene, size or choose_size(scene), sample, fit)
        for count in sorted(set(views))
        for scene in scenes
        for sample in protocol(scene, count)
    ]
    return _checked(FramePlan(name, tuple(tasks)))


def choose_size(scene: Scene) -> tuple[int, int]:
    """240x320, or 320x240 if most frames of the scene are taller than wide."""
    portrait = sum(frame.lens.size[0] > frame.lens.size[1] for frame in scene.frames)
    return LANDSCAPE[::-1] if 2 * portrait > len(scene) else LANDSCAPE


def frame_list(plan: FramePlan) -> dict:
    """The plan by frame name, ready for JSON; `read_plan` reads it."""
    scenes = [
        {
            "scene": scene.name,
            "size": list(first.size),
            **({"fit": first.fit} if first.fit != "stretch" else {}),
            "samples": [
                {
                    "target": task.target,
                    "contexts": list(task.contexts),
                    **({"others": list(task.others)} if task.others else {}),
                }
                for task in plan.tasks
                if task.scene is scene
            ],
        }
        for scene in plan.scenes
        for first in [next(task for task in plan.tasks if task.scene is scene)]
    ]
    return {"format": FORMAT, "version": VERSION, "protocol": plan.protocol, "scenes": scenes}


def read_plan(
    path: str | Path, scenes: Sequence[Scene], views: Sequence[int] = (), size: tuple[int, int] | None = None
) -> FramePlan:
    """The plan in a file: `frames.json` or `report.json` of an evaluation, one written by hand, or an index of pixelSplat's form.

    Args:
        path: of the file.
        scenes: at least those named in the file.
        views: numbers of contexts to use; empty for all.
        size: (height, width) that replaces the size in the file [px].

    Raises:
        InputError: the file cannot be read or has another format, names an unknown scene or frame, has a target with fewer than two
            contexts or with itself as a context, or has no sample for one of the numbers of views.
    """
    content = _frames_of(Path(path))
    known = {scene.name: scene for scene in scenes}
    tasks = []
    for number, entry in enumerate(_list(path, content, "scenes", "frames")):
        place = f"scenes[{number}]"
        name = entry.get("scene") if isinstance(entry, dict) else None
        if not isinstance(name, str) or name not in known:
            raise InputError(path, f"one of the scenes {listed(list(known))}", f"{name!r}", key=f"{place}.scene")
        fit = entry.get("fit", "stretch")
        if fit not in get_args(Fit):
            raise InputError(path, " or ".join(get_args(Fit)), f"{fit!r:.40}", key=f"{place}.fit")
        pinned = _size(path, entry.get("size"), f"{place}.size")
        for index, sample in enumerate(_list(path, entry, "samples", place)):
            one = _sample(path, known[name], sample, f"{place}.samples[{index}]")
            tasks.append(Task(known[name], size or pinned or choose_size(known[name]), one, fit))
    held = sorted({task.views for task in tasks})
    for count in views:
        if count not in held:
            raise InputError(path, f"samples with {count} views", f"only with {', '.join(map(str, held)) or 'none'}")
    kept = [task for task in tasks if not views or task.views in views]
    order = {scene.name: number for number, scene in enumerate(scenes)}
    kept.sort(key=lambda task: (task.views, order[task.scene.name]))  # stable: samples keep their order
    return _checked(FramePlan(f"pinned: {content.get('protocol', 'by hand')}", tuple(kept)))


def index_of(plan: FramePlan) -> dict[str, Any]:
    """The plan as pixelSplat and its descendants list frames, by their positions in the scene; `read_plan` reads it, too.

    Entries of a scene with several sets of contexts are a list, which those programs do not know.
    """
    index: dict[str, Any] = {}
    for scene in plan.scenes:
        targets: dict[tuple[int, ...], list[int]] = {}
        for task in plan.tasks:
            if task.scene is scene:
                targets.setdefault(task.sample.contexts, []).append(task.sample.target)
        entries = [{"context": list(contexts), "target": found} for contexts, found in targets.items()]
        index[scene.name] = entries if len(entries) > 1 else entries[0]
    return index


def _is_index(content: object) -> bool:
    """Whether the content of a file looks like an index of pixelSplat's form."""
    if not isinstance(content, dict) or "format" in content:
        return False
    first = next(
        (one for value in content.values() for one in (value if isinstance(value, list) else [value]) if one), None
    )
    return isinstance(first, dict) and {"context", "target"} <= first.keys()


def _from_index(path: Path, index: dict[str, Any]) -> dict[str, Any]:
    """A list of frames as ours. Scenes without an entry (null) are left out, as in pixelSplat."""
    scenes = []
    for name, value in index.items():
        samples = []
        for entry in value if isinstance(value, list) else [value]:
            if entry is None:
                continue
            held = entry if isinstance(entry, dict) else {}
            contexts, targets = held.get("context"), held.get("target")
            if not isinstance(contexts, list) or not isinstance(targets, list):
                raise InputError(path, "lists of frames, context and target", f"{entry!r:.60}", key=name)
            samples += [{"target": target, "contexts": contexts} for target in targets]
        if samples:
            scenes.append({"scene": name, "samples": samples})
    return {"protocol": f"the index {path.name}", "scenes": scenes}


def _frames_of(path: Path) -> dict:
    """The list of frames in a JSON file."""
    content = read_json(path, "a JSON file of frames")
    if isinstance(content, dict) and isinstance(content.get("frames"), dict):
        content = content["frames"]  # of a report
    if _is_index(content):
        return _from_index(path, content)
    if not isinstance(content, dict) or (content.get("format"), content.get("version")) != (FORMAT, VERSION):
        raise InputError(path, f"format {FORMAT!r}, version {VERSION}", "something else", key="format")
    return content


def _list(path: str | Path, holder: dict, key: str, place: str) -> list:
    """The list under a key, which must not be empty."""
    found = holder.get(key)
    if not isinstance(found, list) or not found:
        raise InputError(path, "a list", f"{found!r:.40}", key=f"{place}.{key}")
    return found


def _size(path: str | Path, value: object, place: str) -> tuple[int, int] | None:
    """(height, width); None if there is none."""
    if value is None:
        return None
    if isinstance(value, list) and len(value) == 2 and all(type(side) is int and side > 0 for side in value):
        return value[0], value[1]
    raise InputError(path, "height and width", f"{value!r:.40}", key=place)


def _sample(path: str | Path, scene: Scene, entry: object, place: str) -> TargetSample:
    """The sample with the given frames, by name or by position: two or more contexts and a target, all different."""
    held = entry if isinstance(entry, dict) else {}
    contexts, others = held.get("contexts"), held.get("others", [])
    given = [part if isinstance(part, list) else [None] for part in (contexts, others)]
    listed = [held.get("target"), *given[0], *given[1]]
    names = [name for name in listed if isinstance(name, str) or type(name) is int]
    if len(given[0]) < 2 or len(names) < len(listed):
        raise InputError(path, "a target and two or more contexts, by name", f"{entry!r:.60}", key=place)
    with input_error(path, f"frames of {scene.name}", key=place):
        positions = [scene.index(name) for name in names]
    if len(set(positions)) != len(positions):
        raise InputError(path, "different frames", ", ".join(map(str, names)), key=place)
    last = 1 + len(given[0])
    return TargetSample(tuple(positions[1:last]), positions[0], tuple(positions[last:]))


def _checked(plan: FramePlan) -> FramePlan:
    """The plan, with a file name of its own for each target."""
    names = {
        scene: distinct_stems({task.sample.target: task.target for task in plan.tasks if task.scene.name == scene})
        for scene in {task.scene.name for task in plan.tasks}
    }
    tasks = tuple(replace(task, file_name=names[task.scene.name][task.sample.target]) for task in plan.tasks)
    twice = [task for task, count in Counter(task.stem for task in tasks).items() if count > 1]
    if twice:
        raise InputError(tasks[0].scene.path, "each target once for a number of views", f"{twice[0]} again")
    return replace(plan, tasks=tasks)


def distinct_stems(names: Mapping[int, str]) -> dict[int, str]:
    """File names without ending for some frames of a scene: those of their images. If several have the same, as in a rig, their positions come first
    (`000_001`), as in the COLMAP models that we export.

    Args:
        names: of the frames, by their positions.
    """
    stems = {position: Path(name).stem for position, name in names.items()}
    numbered, alike = {position: f"{position:03d}_{stem}" for position, stem in stems.items()}, Counter(stems.values())
    found = {position: numbered[position] if alike[stem] > 1 else stem for position, stem in stems.items()}
    return found if len(set(found.values())) == len(found) else numbered
