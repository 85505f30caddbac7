"""The poses of a bag: the motions from the camera's frame up to the world.

Poses come from TF, `nav_msgs/Odometry` or `geometry_msgs/PoseStamped`, along the tree of frames from the image's, which should be optical
(REP 103: x right, y down, z forward), up to the world. If there are several topics of poses, the error lists them, and the user chooses one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from semgs.data.layouts.ros.bag import Bag, stamp_of
from semgs.data.layouts.ros.motions import Motion, make_motion, motions_above
from semgs.data.scene_details import SceneDetails
from semgs.files.errors import InputError
from semgs.files.text import listed
from semgs.runtime.notes import Kind

ODOMETRY = "nav_msgs/msg/Odometry"
TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
POSES = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")

SEVERAL_PARENTS = Kind(
    "TF gives {child} several parents, {parents}; {parent} is used. --world {other} uses another one.",
    "TF gives {child} several parents, {parents}; {parent} is used.",
)
UNNAMED_BODY = Kind(
    "The poses in {source} do not name their frame; they are assumed to be those of the camera's frame {frame} (--body).",
    "The poses in {source} do not name their frame; they are assumed to be those of the camera's frame {frame}.",
)

MOST_BODIES = 3
"""So many moving frames are named."""


def find_route(bag: Bag, frame_id: str, details: SceneDetails) -> tuple[list[Motion], list[str]]:
    """The motions from the camera's frame up to the world, and notes about them.

    Raises:
        InputError: there are no such poses, or several and no choice; the error lists what there is.
    """
    world = None if details.world is None else details.world.lstrip("/")
    tree, others = _tree(bag, world)
    moving = [
        one for topic in (*bag.of(ODOMETRY), *bag.of(*POSES)) if (one := _moving(bag, topic, frame_id, details.body))
    ]
    if details.body is not None and all(_says_of_what(bag.first(step.source)) for step in moving):
        raise InputError(bag.path, "a topic whose poses do not name their frame", str(bag), "body")
    routes = {"TF": motions_above(tree, frame_id)}
    for step in moving:
        routes[step.source] = motions_above({**tree, step.child: step}, frame_id)
    routes = {source: route for source, route in routes.items() if _leads(source, route)}
    if details.world in routes:
        routes = {details.world: routes[details.world]}
    elif details.world is not None:
        cut = {source: _cut(route, world or "") for source, route in routes.items()}
        routes = {source: route for source, route in cut.items() if _leads(source, route)}
    if not routes:
        wanted = frame_id if details.world is None else f"{frame_id} in {details.world},"
        raise InputError(
            bag.path, f"poses of {wanted} by TF, Odometry or PoseStamped", _ways(tree, moving, frame_id), "world",
            advice=_missing_link(tree, moving, frame_id)
            or (None if details.world else "a bag needs /tf and /tf_static, or a topic of poses with /tf_static"),
        )  # fmt: skip
    if "TF" in routes:
        routes = {"TF": routes["TF"]}
    if len(routes) > 1:
        found = "; ".join(f"{source} ({route[-1].parent})" for source, route in routes.items())
        raise InputError(bag.path, "one topic of poses", found, "world", advice="choose one: --world TOPIC")
    source, route = next(iter(routes.items()))
    chain = " > ".join([*(step.parent for step in reversed(route)), frame_id])
    notes: list[str] = [f"Poses are from {source}: {chain}, interpolated in time."]
    notes += [
        SEVERAL_PARENTS(
            child=step.child,
            parents=listed([step.parent, *others[step.child]]),
            parent=step.parent,
            other=others[step.child][0],
        )
        for step in route
        if step.child in others and step is tree[step.child]
    ]
    notes += [
        f"{step.broken} of {step.broken + max(1, len(step.times))} poses of {step.child} in {step.source} are left out, as they are not finite or have a "
        "quaternion of zero: images at their times have interpolated poses."
        for step in route
        if step.broken
    ]
    if source in bag.topics and details.body is None and not _says_of_what(bag.first(source)):
        notes.append(UNNAMED_BODY(source=source, frame=frame_id))
    return route, notes


def _says_of_what(message: Any) -> bool:
    """Whether a message with a pose names the frame that it describes, as Odometry does."""
    return bool(getattr(message, "child_frame_id", ""))


def _leads(source: str, route: list[Motion]) -> bool:
    """Whether a route moves and uses its source (TF always counts as used)."""
    return any(not step.fixed for step in route) and (source == "TF" or any(step.source == source for step in route))


def _cut(route: list[Motion], world: str) -> list[Motion]:
    """The part of a route that ends in a frame; empty if the frame is not on it."""
    return next((route[: index + 1] for index, step in enumerate(route) if step.parent == world), [])


def _tree(bag: Bag, world: str | None) -> tuple[dict[str, Motion], dict[str, list[str]]]:
    """The motions of TF by child, and other parents of those that move in several. If one is both static and moving, it is the moving one; of several parents, it is one below the
    wanted world, else the one with most poses."""
    samples: dict[tuple[str, str, bool], dict[int, tuple[np.ndarray, np.ndarray]]] = {}
    for (topic, logged), message in bag.messages(bag.of(*TF)):
        fixed = topic.endswith("tf_static")
        for one in message.transforms:
            key = (one.header.frame_id, one.child_frame_id, fixed)
            time = logged if fixed else stamp_of(one)
            held_at = samples.setdefault(key, {})
            if fixed or time not in held_at:  # like tf2, which ignores repeated times
                held_at[time] = _sample(one.transform.translation, one.transform.rotation)
    found: dict[str, Motion] = {}
    moving: dict[str, dict[str, Motion]] = {}
    for (parent, child, fixed), held in sorted(samples.items(), key=lambda item: (not item[0][2], len(item[1]))):
        step = make_motion(parent, child, held, "/tf_static" if fixed else "/tf", fixed=fixed)
        if step is not None:
            found[step.child] = step
            if not fixed:
                moving.setdefault(step.child, {})[step.parent] = step
    several = {child: steps for child, steps in moving.items() if len(steps) > 1}
    for child, steps in several.items():
        for parent, step in steps.items():
            if world in (parent, *(above.parent for above in motions_above(found, parent))):
                found[child] = step
    return found, {
        child: [parent for parent in steps if parent != found[child].parent] for child, steps in several.items()
    }


def _moving(bag: Bag, topic: str, frame_id: str, body: str | None) -> Motion | None:
    """The motion of an Odometry or PoseStamped topic; None if it has no pose."""
    samples: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    parent = child = ""
    for _, message in bag.messages([topic]):
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        parent, child = message.header.frame_id, getattr(message, "child_frame_id", "") or body or frame_id
        samples.setdefault(stamp_of(message), _sample(pose.position, pose.orientation))
    return make_motion(parent or topic, child, samples, topic)


def _sample(place: Any, turn: Any) -> tuple[np.ndarray, np.ndarray]:
    """Position [3] and quaternion [4] (x, y, z, w) of a message."""
    return np.array([place.x, place.y, place.z]), np.array([turn.x, turn.y, turn.z, turn.w])


def _missing_link(tree: Mapping[str, Motion], moving: Iterable[Motion], frame_id: str) -> str | None:
    """What to do if there are frames that move, and the camera is not below any of them; None otherwise."""
    route = motions_above(tree, frame_id)
    steps = [step for step in (*tree.values(), *moving) if not step.fixed]
    bodies = sorted({step.child for step in steps} - {step.parent for step in steps})
    if not bodies or any(not step.fixed for step in route):
        return None
    top = route[-1].parent if route else frame_id
    return (
        f"no transform leads from {' or '.join(bodies[:MOST_BODIES])}, which moves, to {top}: record it on /tf_static, "
        "for example from static_transform_publisher"
    )


def _ways(tree: Mapping[str, Motion], moving: Iterable[Motion], frame_id: str) -> str:
    """The poses that there are, for errors."""
    route = motions_above(tree, frame_id)
    chain = " < ".join([frame_id, *(step.parent for step in route)])
    still = "" if any(not step.fixed for step in route) else ", which never moves"
    elsewhere = [step for step in tree.values() if not step.fixed and step not in route][:MOST_BODIES]
    none = f"TF of other frames, none of {frame_id}" if tree else "no TF"
    ways = [
        f"TF from the camera up: {chain}{still}" if route else none,
        *(f"{one.source}: {one.parent} > {one.child}" for one in (*elsewhere, *moving)),
    ]
    return "; ".join(ways)
