"""Time and memory of one frame of a large splat on the CPU.

    python scripts/large_splat.py [GAUSSIANS]

A room of 5 x 5 x 3 m: half of the Gaussians are on its walls, floor and ceiling, the others anywhere inside, with standard deviations of 5 to 15 mm and
harmonics of degree 3. A camera inside renders 480x640. Prints the seconds of the best of three frames after the first one, which compiles; the CPU time of the
process in it, which other programs on the machine hardly change; and its peak memory.
"""

from __future__ import annotations

import json
import resource
import sys
import time

import torch

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering.render import render

ROOM = (5.0, 5.0, 3.0)  # [m]
SIZE = (480, 640)
SIGMAS = (0.005, 0.015)  # [m]


def random_room(count: int) -> Gaussians:
    """Gaussians on the sides of a room and inside."""
    draw = torch.Generator().manual_seed(0)
    means = torch.rand(count, 3, generator=draw) * torch.tensor(ROOM)
    sides = torch.randint(3, (count // 2,), generator=draw)
    ends = torch.randint(2, (count // 2,), generator=draw)
    means[torch.arange(count // 2), sides] = ends * torch.tensor(ROOM)[sides]
    low, high = SIGMAS
    colour = Appearance(
        quaternions=torch.nn.functional.normalize(torch.randn(count, 4, generator=draw), dim=-1),
        scales=low + (high - low) * torch.rand(count, 3, generator=draw),
        features=0.3 * torch.randn(count, 16, 3, generator=draw),
    )
    return Gaussians(means, torch.rand(count, generator=draw), colour)


def inside() -> Cameras:
    """A camera in the middle of the room, looking along x."""
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = torch.tensor([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    pose[:3, 3] = torch.tensor(ROOM) / 2
    height, width = SIZE
    intrinsics = torch.tensor([[500.0, 0, width / 2], [0, 500, height / 2], [0, 0, 1]], dtype=torch.float64)
    return Cameras(pose[None], intrinsics[None], SIZE)


def main(count: int) -> None:
    """Measure, and print the numbers as JSON."""
    gaussians, camera = random_room(count), inside()
    seconds, worked = [], []
    with torch.no_grad():
        for _ in range(4):
            start, cpu = time.perf_counter(), time.process_time()
            render(gaussians, camera, near=0.5)
            seconds.append(time.perf_counter() - start)
            worked.append(time.process_time() - cpu)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    numbers = {"seconds": min(seconds[1:]), "CPU seconds": min(worked[1:]), "peak GB": peak}
    print(json.dumps({"gaussians": count} | {name: round(value, 2) for name, value in numbers.items()}))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
