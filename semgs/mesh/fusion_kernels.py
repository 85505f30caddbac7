"""Numba kernel: a depth map into the voxels of a truncated signed distance field. `tests/mesh/test_depth_into_voxels.py` has the same in NumPy, as its specification.

A pixel stands for a small plane, whose inverse depth is linear in the image: with x and y on the image at z = 1 it is a x + b y + c. So its normal is (a, b, c), and a
point at depth Z has the distance (1 - Z / depth) / |(a, b, c)| from it. The weight is the cosine between ray and normal, times what the pixel is worth (Curless and Levoy,
"A volumetric method for building complex models from range images", SIGGRAPH 1996). Behind the surface it falls to zero: a view knows little of what it does not see.
"""

from __future__ import annotations

import math

from semgs.runtime.jit import njit


@njit(error_model="numpy", nogil=True)
def integrate(sums, weights, blocks, voxel, truncation, planes, worth, camera_from_world, lens, part, parts):
    """Add the signed distances that a depth map gives, positive in front of the surface. What is hidden behind it by more than the truncation stays as it is.

    Args:
        sums, weights: [b side side side], distances times weights, in units of the truncation, and weights; changed.
        blocks: [b 3], places of the blocks; voxel (i, j, k) of a block is at (side * block + (i, j, k)) * voxel.
        voxel, truncation: [unit of the scene].
        planes: [h w 3], inverse depth at the middle of each pixel, and how it changes from one pixel to the right and downwards.
        worth: [h w], how much pixels count; 0 for not at all, and wherever depth is unknown.
        camera_from_world: [4 4].
        lens: [4], both focal lengths and the principal point [px].
    """
    height, width = worth.shape
    side = sums.shape[1]
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    pose = camera_from_world
    radius = voxel * side * math.sqrt(3.0) / 2
    for block in range(part, len(blocks), parts):
        x = (blocks[block, 0] + 0.5) * side * voxel
        y = (blocks[block, 1] + 0.5) * side * voxel
        z = (blocks[block, 2] + 0.5) * side * voxel
        depth = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
        if depth < -radius:
            continue
        if depth > 2 * radius:  # the image of the block is smaller than this
            reach = radius / (depth - radius)
            u = (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]) / depth
            v = (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]) / depth
            wide, high = reach * (1 + abs(u)), reach * (1 + abs(v))
            if fx * (u + wide) + cx < 0 or fx * (u - wide) + cx > width:
                continue
            if fy * (v + high) + cy < 0 or fy * (v - high) + cy > height:
                continue
        for i in range(side):
            for j in range(side):
                for k in range(side):
                    x = (side * blocks[block, 0] + i) * voxel
                    y = (side * blocks[block, 1] + j) * voxel
                    z = (side * blocks[block, 2] + k) * voxel
                    depth = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
                    if depth <= 0:
                        continue
                    u = (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]) / depth
                    v = (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]) / depth
                    right, down = fx * u + cx, fy * v + cy
                    if not (0 <= right < width and 0 <= down < height):
                        continue
                    column, row = int(right), int(down)
                    if worth[row, column] <= 0:
                        continue
                    across, along = planes[row, column, 1], planes[row, column, 2]
                    near = planes[row, column, 0] + (right - column - 0.5) * across + (down - row - 0.5) * along
                    if near <= 0:
                        continue
                    a, b = fx * across, fy * along
                    c = near - a * u - b * v
                    length = math.sqrt(a * a + b * b + c * c)
                    distance = (1 - depth * near) / (length * truncation)
                    if distance < -1:
                        continue
                    weight = worth[row, column] * near / (length * math.sqrt(1 + u * u + v * v))
                    weight *= min(1 + distance, 1.0)
                    sums[block, i, j, k] += weight * min(distance, 1.0)
                    weights[block, i, j, k] += weight
