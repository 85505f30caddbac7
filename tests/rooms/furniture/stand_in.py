"""What Infinigen's environment would do, without Infinigen: boxes of given sizes, and whatever goes wrong when it is told to.

STAND_IN holds JSON: "sizes" by kind [m], in Infinigen's frame, and "ways" by name of a piece, for those that go wrong.
"""

import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

MATERIALS = ("cloth", "rod", "frame", "pane", "shader_marble", "shader_metal", "shader_wood", "shader_knit_fabric")


def box(size, steps=3):
    """A box on the ground, each face of `steps` by `steps` squares, and texture coordinates."""
    grid = np.linspace(0, 1, steps + 1)
    corners, uv = [], []
    for axis in range(3):
        for side in (0.0, 1.0):
            for i in range(steps):
                for j in range(steps):
                    square = [
                        (grid[i], grid[j]),
                        (grid[i + 1], grid[j]),
                        (grid[i + 1], grid[j + 1]),
                        (grid[i], grid[j + 1]),
                    ]
                    points = [np.insert(np.array(p), axis, side) for p in square]
                    for k in (1, 2):
                        corners.append([points[0], points[k], points[k + 1]])
                        uv.append([square[0], square[k], square[k + 1]])
    return (np.array(corners) - [0.5, 0.5, 0]) * size, np.array(uv)


def make(one, size, way):
    """The arrays of one make."""
    corners, uv = box(np.array(size))
    if way == "stray":
        corners[0] = corners[0, 0] + [[0, 0, 0], [0, 0.02, 0], [0, 0, 2 * size[2]]]
    if way == "hanging":
        corners = np.concatenate((corners, corners + np.array([0, 0, 2 * size[2]])))
        uv = np.concatenate((uv, uv))
    count = len(corners)
    side = one["picture"]
    arrays = {
        "vertices": corners.reshape(-1, 3).astype(np.float32),
        "faces": np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        "uv": uv.astype(np.float32),
        "object": np.zeros(count, np.int32),
        "material": (np.arange(count) % len(MATERIALS)).astype(np.int32),
        "materials": np.array(MATERIALS),
        "picture": np.random.default_rng(one["seed"]).integers(0, 255, (side, side, 3), dtype=np.uint8),
    }
    if way == "wrong":
        arrays["faces"][0, 0] = 10**6  # a number that no vertex has
    if way == "pickle":
        arrays["materials"] = np.array([{"a": 1}], dtype=object)
    return arrays


def main(orders, out):
    told = json.loads(os.environ["STAND_IN"])
    for job in json.loads(Path(orders).read_text()):
        way = told["ways"].get(job["name"], "")
        with Path(told["calls"]).open("a") as calls:
            calls.write(job["name"] + "\n")
        if way == "broken":
            sys.exit("ImportError: libXi.so.6: cannot open shared object file")
        if way == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        if way == "slow":
            time.sleep(60)
        if way == "error":
            Path(out, f"{job['name']}.txt").write_text("ValueError: cannot be made")
            continue
        size = told["sizes"][job["name"].split("_")[1]]
        makes = [make(one, size, way) for one in job["makes"]]
        with Path(out, f"{job['name']}.npz").open("wb") as file:
            np.savez(file, **{f"{k}/{key}": array for k, one in enumerate(makes) for key, array in one.items()})


if __name__ == "__main__":
    main(*sys.argv[2:])  # the first is the program whose place it takes
