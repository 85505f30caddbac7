"""Frames per second of labels and depth that are cast at the mesh of a ScanNet++ scan; at a bumpy room of so many triangles by default.

The mesh is written and read as ScanNet++ stores it, so that reading it is measured too. Times are of the processor, on one thread.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh

from semgs.data.layouts.scannetpp import mesh as scannetpp_mesh

ROOM = (6.0, 5.0, 3.0)
SIZES = {"240x320": (240, 320), "1168x1752 (DSLR)": (1168, 1752), "1440x1920 (iPhone)": (1440, 1920)}


def bumpy_room(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [m] and triangles of a room whose six sides are grids with bumps of some centimetres."""
    side = math.ceil((triangles / 12) ** 0.5)
    across = np.linspace(0, 1, side + 1)
    u, v = (one.ravel() for one in np.meshgrid(across, across, indexing="ij"))
    bump = 0.03 * np.sin(40 * u) * np.sin(37 * v) + 0.004 * np.random.default_rng(0).normal(size=len(u))
    number = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    corners = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    a, b, c, d = (one.ravel() for one in corners)
    grid = np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))
    vertices, faces = [], []
    for axis in range(3):
        for end in (0.0, 1.0):
            places = np.empty((len(u), 3))
            places[:, axis], places[:, axis - 2], places[:, axis - 1] = end, u, v
            places *= ROOM
            places[:, axis] += bump if end == 0 else -bump
            faces.append(grid + len(vertices) * len(u))
            vertices.append(places)
    return np.concatenate(vertices), np.concatenate(faces)


def write_scans(folder: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    """The mesh, each vertex a segment of its own as in ScanNet++, and two hundred objects."""
    trimesh.Trimesh(vertices, faces, process=False).export(folder / scannetpp_mesh.MESH)
    (folder / scannetpp_mesh.SEGMENTS).write_text(json.dumps({"segIndices": list(range(len(vertices)))}))
    parts = np.array_split(np.arange(len(vertices)), 200)
    groups = [{"label": "wall" if n % 2 else "floor", "segments": part.tolist()} for n, part in enumerate(parts)]
    (folder / scannetpp_mesh.ANNOTATIONS).write_text(json.dumps({"segGroups": groups}))


def pose(turn: float) -> np.ndarray:
    """Camera to world of a camera in the middle of the room that looks level, turned by an angle [rad]."""
    forward = np.array([np.cos(turn), np.sin(turn), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    result = np.eye(4)
    result[:3] = np.stack((np.cross(down, forward), down, forward, np.array(ROOM) / 2), axis=1)
    return result


def seconds(run: Callable[[], object]) -> float:
    """Of the processor."""
    began = time.process_time()
    run()
    return time.process_time() - began


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--triangles", type=int, default=2_000_000)
    parser.add_argument("--scans", type=Path, help="a scan's own folder scans/, in place of the bumpy room")
    parser.add_argument("--frames", type=int, default=4)
    asked = parser.parse_args()
    with TemporaryDirectory() as temporary:
        folder = asked.scans or Path(temporary)
        if asked.scans is None:
            write_scans(folder, *bumpy_room(asked.triangles))
        mesh = scannetpp_mesh.LabelledMesh(folder, "timing", (("wall", 0), ("floor", 1)))
        state: list[scannetpp_mesh.Cast] = []
        read = seconds(lambda: state.append(scannetpp_mesh._mesh(folder, mesh.labels, ())))
        print(f"{len(state[0].labels)} triangles: read and ready for rays in {read:.1f} s")
        for name, (height, width) in SIZES.items():
            k = np.array([[0.45 * width, 0, width / 2], [0, 0.45 * width, height / 2], [0, 0, 1]])
            turns = np.linspace(0, 2 * np.pi, asked.frames, endpoint=False)
            spent = [seconds(lambda: state[0].cast(pose(turn), k, (height, width))) for turn in turns]  # noqa: B023
            print(f"{name}: {np.median(spent):.3f} s a frame, {1 / np.median(spent):.2f} frames a second")


if __name__ == "__main__":
    main()
