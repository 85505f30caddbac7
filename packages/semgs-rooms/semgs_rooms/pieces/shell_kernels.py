"""Kernels for shells: corner normals, points sampled on triangles, distances to points."""

from __future__ import annotations

import numpy as np

from semgs.runtime.jit import njit


@njit()
def mean_normals(groups, order, faces, crease, normals):
    """Write the normal of each corner: the sum of the faces in its group that differ by less than the crease angle from its own.

    `groups` has one number for all corners at one position, `order` sorts it; `faces` has each triangle's normal times its area.
    """
    start = 0
    while start < len(order):
        end = start
        while end < len(order) and groups[order[end]] == groups[order[start]]:
            end += 1
        for i in range(start, end):
            own = faces[order[i] // 3]
            length = np.sqrt(own[0] ** 2 + own[1] ** 2 + own[2] ** 2)
            x, y, z = own[0], own[1], own[2]
            for j in range(start, end):
                face = faces[order[j] // 3]
                size = np.sqrt(face[0] ** 2 + face[1] ** 2 + face[2] ** 2)
                inner = own[0] * face[0] + own[1] * face[1] + own[2] * face[2]
                if j != i and inner > crease * length * size:
                    x, y, z = x + face[0], y + face[1], z + face[2]
            norm = max(np.sqrt(x * x + y * y + z * z), 1e-30)
            normals[order[i], 0], normals[order[i], 1], normals[order[i], 2] = x / norm, y / norm, z / norm
        start = end


@njit()
def distance_to_points(field, corner, step, reach, points):
    """Lower `field` to each node's distance to the nearest point, where that is below `reach` [m]."""
    cells = int(np.ceil(reach / step))
    for p in range(len(points)):
        px, py, pz = (
            (points[p, 0] - corner[0]) / step,
            (points[p, 1] - corner[1]) / step,
            (points[p, 2] - corner[2]) / step,
        )
        ci, cj, ck = int(np.floor(px)), int(np.floor(py)), int(np.floor(pz))
        for i in range(max(0, ci - cells), min(field.shape[0], ci + cells + 2)):
            for j in range(max(0, cj - cells), min(field.shape[1], cj + cells + 2)):
                flat = (i - px) ** 2 + (j - py) ** 2
                if flat * step * step >= reach * reach:
                    continue
                for k in range(max(0, ck - cells), min(field.shape[2], ck + cells + 2)):
                    squared = (flat + (k - pz) ** 2) * step * step
                    if squared < field[i, j, k] * field[i, j, k]:
                        field[i, j, k] = np.sqrt(squared)


@njit()
def scatter(corners, spacing):
    """Points on triangles about `spacing` apart [m], one per grid cell of that size."""
    seen = set()
    points = [(0.0, 0.0, 0.0)]
    points.pop()
    for t in range(len(corners)):
        a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
        longest = 0.0
        for k in range(3):
            e, f = corners[t, k], corners[t, (k + 1) % 3]
            longest = max(longest, np.sqrt((e[0] - f[0]) ** 2 + (e[1] - f[1]) ** 2 + (e[2] - f[2]) ** 2))
        count = max(1, int(np.ceil(longest / spacing)))
        for i in range(count + 1):
            for j in range(count + 1 - i):
                u, v = i / count, j / count
                x = a[0] + u * (b[0] - a[0]) + v * (c[0] - a[0])
                y = a[1] + u * (b[1] - a[1]) + v * (c[1] - a[1])
                z = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2])
                key = (int(np.floor(x / spacing)), int(np.floor(y / spacing)), int(np.floor(z / spacing)))
                if key not in seen:
                    seen.add(key)
                    points.append((x, y, z))
    out = np.empty((len(points), 3))
    for i in range(len(points)):
        out[i, 0], out[i, 1], out[i, 2] = points[i]
    return out


@njit()
def cover(uv, used):
    """Set pixels to 1 if their centre is inside a triangle of texture coordinates [t 3 2]; `used` is [h w]."""
    height, width = used.shape
    for t in range(len(uv)):
        ax, ay = uv[t, 0, 0] * width - 0.5, uv[t, 0, 1] * height - 0.5
        bx, by = uv[t, 1, 0] * width - 0.5, uv[t, 1, 1] * height - 0.5
        cx, cy = uv[t, 2, 0] * width - 0.5, uv[t, 2, 1] * height - 0.5
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0:
            continue
        for row in range(max(0, int(np.ceil(min(ay, by, cy)))), min(height - 1, int(np.floor(max(ay, by, cy)))) + 1):
            for column in range(
                max(0, int(np.ceil(min(ax, bx, cx)))), min(width - 1, int(np.floor(max(ax, bx, cx)))) + 1
            ):
                p = ((bx - column) * (cy - row) - (by - row) * (cx - column)) / area
                q = ((cx - column) * (ay - row) - (cy - row) * (ax - column)) / area
                if p >= 0 and q >= 0 and p + q <= 1:
                    used[row, column] = 1
