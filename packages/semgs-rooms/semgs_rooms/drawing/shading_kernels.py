"""Kernels for the points that rays hit: their positions, normals, lighting and colours."""

from __future__ import annotations

import math

import numpy as np

from semgs.runtime.jit import njit
from semgs_rooms.drawing.light_kernels import stratum
from semgs_rooms.pieces.picture_kernels import picture
from semgs_rooms.pieces.texture_kernels import EMISSION, GLOSS, KIND, PICTURE, texture

LIGHT_WIDTH = 16
LAMP, WINDOW, SUN = range(3)
"""Kinds of light, stored in element 0 of a light. Elements 1-3: its position (of the sun: the centre of the window it shines
through); 4-6: colour; 7-9: the direction it faces (of the sun: the direction of its light); 10-12: half the window's width, as a
vector; 13: half its height."""

LAMP_RADIUS = 0.12
"""Half the size of a lamp [m]."""

CYLINDER, BALL, CUSHION, SHELL = 1, 2, 3, 4


@njit()
def locate(
    triangles,
    origins,
    directions,
    spread,
    planes,
    owners,
    rotations,
    centres,
    sizes,
    shapes,
    first,
    corners,
    corner_normals,
    corner_uv,
    density,
    depths,
    places,
    normals,
    feet,
    uv,
):
    """Exact intersections of rays with the planes of the triangles they hit.

    `planes` contains each triangle's unit normal and offset; `spread` is a pixel's width at depth 1. The triangles of shells start at
    `first`; `corners`, `corner_normals`, `corner_uv` and `density` are theirs.

    Writes `depths` in lengths of the direction (z-depth if the direction has camera z = 1; 0 if nothing was hit), `places`,
    `normals` for shading (towards the ray's origin, smooth on round shapes), `feet`, the width of a pixel there, and on shells
    `uv`, the texture coordinates and a pixel's width in them.
    """
    for r in range(len(triangles)):
        triangle = triangles[r]
        if triangle < 0:
            depths[r] = 0.0
            continue
        nx, ny, nz = planes[triangle, 0], planes[triangle, 1], planes[triangle, 2]
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        ox, oy, oz = origins[r, 0], origins[r, 1], origins[r, 2]
        approach = nx * dx + ny * dy + nz * dz
        depth = (planes[triangle, 3] - nx * ox - ny * oy - nz * oz) / approach
        depths[r] = depth
        x, y, z = ox + depth * dx, oy + depth * dy, oz + depth * dz
        places[r, 0], places[r, 1], places[r, 2] = x, y, z
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        part = owners[triangle]
        shape = shapes[part]
        foot = spread * depth * length / max(abs(approach) / length, 0.2)
        if shape == SHELL:
            own = triangle - first
            b, c = barycentric(corners[own], x, y, z)
            a = 1 - b - c
            uv[r, 0] = a * corner_uv[own, 0, 0] + b * corner_uv[own, 1, 0] + c * corner_uv[own, 2, 0]
            uv[r, 1] = a * corner_uv[own, 0, 1] + b * corner_uv[own, 1, 1] + c * corner_uv[own, 2, 1]
            uv[r, 2] = foot * density[own]
            if approach > 0:
                nx, ny, nz = -nx, -ny, -nz
            sx = a * corner_normals[own, 0, 0] + b * corner_normals[own, 1, 0] + c * corner_normals[own, 2, 0]
            sy = a * corner_normals[own, 0, 1] + b * corner_normals[own, 1, 1] + c * corner_normals[own, 2, 1]
            sz = a * corner_normals[own, 0, 2] + b * corner_normals[own, 1, 2] + c * corner_normals[own, 2, 2]
            norm = math.sqrt(sx * sx + sy * sy + sz * sz)
            if approach > 0:
                norm = -norm
            if abs(norm) > 0.5 and (sx * dx + sy * dy + sz * dz) / norm < 0:
                nx, ny, nz = sx / norm, sy / norm, sz / norm
        elif shape != 0:
            turn = rotations[part]
            ax, ay, az = x - centres[part, 0], y - centres[part, 1], z - centres[part, 2]
            lx = turn[0, 0] * ax + turn[1, 0] * ay + turn[2, 0] * az
            ly = turn[0, 1] * ax + turn[1, 1] * ay + turn[2, 1] * az
            lz = turn[0, 2] * ax + turn[1, 2] * ay + turn[2, 2] * az
            sx, sy, sz = 2 / sizes[part, 0], 2 / sizes[part, 1], 2 / sizes[part, 2]
            along = nx * turn[0, 2] + ny * turn[1, 2] + nz * turn[2, 2]
            if shape == CYLINDER:
                if abs(along) < 0.9:
                    lx, ly, lz = lx * sx * sx, ly * sy * sy, 0.0
                else:
                    lx, ly, lz = 0.0, 0.0, along
            elif shape == BALL:
                lx, ly, lz = lx * sx * sx, ly * sy * sy, lz * sz * sz
            else:
                lx, ly, lz = (lx * sx) ** 3 * sx, (ly * sy) ** 3 * sy, (lz * sz) ** 3 * sz
            nx = turn[0, 0] * lx + turn[0, 1] * ly + turn[0, 2] * lz
            ny = turn[1, 0] * lx + turn[1, 1] * ly + turn[1, 2] * lz
            nz = turn[2, 0] * lx + turn[2, 1] * ly + turn[2, 2] * lz
            norm = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
            nx, ny, nz = nx / norm, ny / norm, nz / norm
        facing = (nx * dx + ny * dy + nz * dz) / length
        if shape == 0 and facing > 0:
            nx, ny, nz = -nx, -ny, -nz
        normals[r, 0], normals[r, 1], normals[r, 2] = nx, ny, nz
        feet[r] = foot


@njit()
def barycentric(corners, x, y, z):
    """Barycentric weights of the second and third corner at a point of a triangle [3 3]."""
    ax, ay, az = corners[0, 0], corners[0, 1], corners[0, 2]
    ex, ey, ez = corners[1, 0] - ax, corners[1, 1] - ay, corners[1, 2] - az
    fx, fy, fz = corners[2, 0] - ax, corners[2, 1] - ay, corners[2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    ee, ef, ff = ex * ex + ey * ey + ez * ez, ex * fx + ey * fy + ez * fz, fx * fx + fy * fy + fz * fz
    pe, pf = px * ex + py * ey + pz * ez, px * fx + py * fy + pz * fz
    area = max(ee * ff - ef * ef, 1e-30)
    return (ff * pe - ef * pf) / area, (ee * pf - ef * pe) / area


@njit()
def towards_light(light, triangles, places, normals, width, origins, ways, strength):
    """Shadow rays from places to one light, and its unshadowed strength there (0 if its light cannot arrive).

    Rays start 4 mm off the surface and end, at length 1, 3 % before the light. Neighbouring pixels aim at different points of the
    light, so that shadows can be smoothed (`light_kernels.smooth`). `width` is the number of pixels per row.
    """
    kind = int(light[0])
    across_x, across_y, up = (
        (light[10], light[11], light[13]) if kind == WINDOW else (LAMP_RADIUS, LAMP_RADIUS, LAMP_RADIUS)
    )
    for r in range(len(triangles)):
        strength[r] = 0.0
        if triangles[r] < 0:
            continue
        x, y, z = places[r, 0], places[r, 1], places[r, 2]
        nx, ny, nz = normals[r, 0], normals[r, 1], normals[r, 2]
        if kind == SUN:
            wx, wy, wz = -light[7], -light[8], -light[9]
            across = math.hypot(light[10], light[11])
            ux, uy = light[10] / across, light[11] / across
            mx, my = -uy, ux
            speed = wx * mx + wy * my
            if abs(speed) < 1e-3:
                continue
            way = ((light[1] - x) * mx + (light[2] - y) * my) / speed
            if way <= 0.02:
                continue
            side = (x + way * wx - light[1]) * ux + (y + way * wy - light[2]) * uy
            height = z + way * wz - light[3]
            if abs(side) > across or abs(height) > light[13]:
                continue
            cosine = nx * wx + ny * wy + nz * wz
            wx, wy, wz = way * wx, way * wy, way * wz
            falloff = 1.0
        else:
            wx, wy, wz = light[1] - x, light[2] - y, light[3] - z
            squared = wx * wx + wy * wy + wz * wz + 1e-9
            distance = math.sqrt(squared)
            cosine = (nx * wx + ny * wy + nz * wz) / distance
            falloff = 1 / (squared + 0.4)
            if kind == WINDOW:
                emitted = -(light[7] * wx + light[8] * wy + light[9] * wz) / distance
                falloff *= max(emitted, 0.0) * 0.85 + 0.15
                cosine = 0.8 * cosine + 0.2
            side, height = stratum(r, width, 0, 1)
            side, height = 1.8 * side - 0.9, 1.8 * height - 0.9
            wx, wy, wz = wx + side * across_x, wy + side * across_y, wz + height * up
        if cosine <= 0:
            continue
        strength[r] = cosine * falloff
        origins[r, 0], origins[r, 1], origins[r, 2] = x + 0.004 * nx, y + 0.004 * ny, z + 0.004 * nz
        ways[r, 0], ways[r, 1], ways[r, 2] = 0.97 * wx, 0.97 * wy, 0.97 * wz


@njit()
def clearance(field, corner, step, x, y, z):
    """Distance to the nearest solid, interpolated in its grid [m]."""
    gx = min(max((x - corner[0]) / step, 0.0), field.shape[0] - 1.001)
    gy = min(max((y - corner[1]) / step, 0.0), field.shape[1] - 1.001)
    gz = min(max((z - corner[2]) / step, 0.0), field.shape[2] - 1.001)
    i, j, k = int(gx), int(gy), int(gz)
    a, b, c = gx - i, gy - j, gz - k
    low = (1 - a) * ((1 - b) * field[i, j, k] + b * field[i, j + 1, k]) + a * (
        (1 - b) * field[i + 1, j, k] + b * field[i + 1, j + 1, k]
    )
    high = (1 - a) * ((1 - b) * field[i, j, k + 1] + b * field[i, j + 1, k + 1]) + a * (
        (1 - b) * field[i + 1, j, k + 1] + b * field[i + 1, j + 1, k + 1]
    )
    return (1 - c) * low + c * high


@njit()
def clearances(field, corner, step, places, out):
    """`clearance` of many places [n 3]."""
    for i in range(len(places)):
        out[i] = clearance(field, corner, step, places[i, 0], places[i, 1], places[i, 2])


@njit()
def distance_field(field, corner, step, reach, rotations, centres, sizes):
    """Lower `field` to each node's distance from the bounding boxes of the parts, where that is below `reach` [m]."""
    for p in range(len(centres)):
        turn = rotations[p]
        hx, hy, hz = sizes[p, 0] / 2, sizes[p, 1] / 2, sizes[p, 2] / 2
        low, high = np.empty(3, np.int64), np.empty(3, np.int64)
        for axis in range(3):
            extent = abs(turn[axis, 0]) * hx + abs(turn[axis, 1]) * hy + abs(turn[axis, 2]) * hz + reach
            low[axis] = max(0, math.ceil((centres[p, axis] - extent - corner[axis]) / step))
            high[axis] = min(field.shape[axis] - 1, math.floor((centres[p, axis] + extent - corner[axis]) / step))
        for i in range(low[0], high[0] + 1):
            x = corner[0] + i * step - centres[p, 0]
            for j in range(low[1], high[1] + 1):
                y = corner[1] + j * step - centres[p, 1]
                for k in range(low[2], high[2] + 1):
                    z = corner[2] + k * step - centres[p, 2]
                    dx = max(abs(turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z) - hx, 0.0)
                    dy = max(abs(turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z) - hy, 0.0)
                    dz = max(abs(turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z) - hz, 0.0)
                    squared = dx * dx + dy * dy + dz * dz
                    if squared < field[i, j, k] * field[i, j, k]:
                        field[i, j, k] = math.sqrt(squared)


@njit()
def colour_at(
    part, place, normal, direction, foot, uv, rotations, centres, sizes, materials, shifts, pixels, table, local, facing, out
):  # fmt: skip
    """Write the linear RGB of a part's material at a place on it into `out` [3]; `local` and `facing` [3] are scratch space."""
    material = materials[part]
    turn = rotations[part]
    ax, ay, az = place[0] - centres[part, 0], place[1] - centres[part, 1], place[2] - centres[part, 2]
    x = turn[0, 0] * ax + turn[1, 0] * ay + turn[2, 0] * az
    y = turn[0, 1] * ax + turn[1, 1] * ay + turn[2, 1] * az
    z = turn[0, 2] * ax + turn[1, 2] * ay + turn[2, 2] * az
    nx, ny, nz = normal[0], normal[1], normal[2]
    mx = abs(turn[0, 0] * nx + turn[1, 0] * ny + turn[2, 0] * nz)
    my = abs(turn[0, 1] * nx + turn[1, 1] * ny + turn[2, 1] * nz)
    mz = abs(turn[0, 2] * nx + turn[1, 2] * ny + turn[2, 2] * nz)
    if mz >= mx and mz >= my:
        u, v = (x, y) if sizes[part, 0] >= sizes[part, 1] else (y, x)
    elif mx >= my:
        u, v = y, z
    else:
        u, v = x, z
    if material[KIND] == PICTURE:
        local[0], local[1], local[2] = x, y, z
        facing[0], facing[1], facing[2] = mx, my, mz
        picture(pixels, table, material, local, facing, sizes[part], direction, uv, foot, shifts[part], out)
    else:
        texture(material, x, y, z, u, v, foot, shifts[part], out)


@njit()
def shade(
    triangles, directions, places, normals, feet, uv, owners, rotations, centres, sizes, materials, shifts, pixels, table,
    lights, strengths, round_about, seen, colours,
):  # fmt: skip
    """Write the linear RGB radiance along each ray into `colours` [r 3].

    It is the emission of the material, or else albedo times light, plus a soft highlight on glossy materials. Light is the indirect
    light `round_about` [r 3] plus every light times its visible share `seen`; a fifth of a hidden light (except the sun) still
    arrives, as if reflected by the walls.
    """
    albedo, local, facing = np.empty(3), np.empty(3), np.empty(3)
    for r in range(len(triangles)):
        if triangles[r] < 0:
            colours[r, 0] = colours[r, 1] = colours[r, 2] = 0.0
            continue
        part = owners[triangles[r]]
        material = materials[part]
        px, py, pz = places[r, 0], places[r, 1], places[r, 2]
        nx, ny, nz = normals[r, 0], normals[r, 1], normals[r, 2]
        colour_at(
            part, places[r], normals[r], directions[r], feet[r], uv[r], rotations, centres, sizes, materials, shifts,
            pixels, table, local, facing, albedo,
        )  # fmt: skip

        up = 0.85 + 0.15 * nz
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        highlight = 0.0
        for k in range(3):
            colours[r, k] = albedo[k] * round_about[r, k] * up
        for number in range(len(lights)):
            if strengths[number, r] == 0.0:
                continue
            spill = 0.0 if lights[number, 0] == SUN else 0.2
            arriving = strengths[number, r] * (spill + (1 - spill) * seen[r, number])
            if material[GLOSS] > 0 and lights[number, 0] != SUN:
                wx, wy, wz = lights[number, 1] - px, lights[number, 2] - py, lights[number, 3] - pz
                norm = math.sqrt(wx * wx + wy * wy + wz * wz) + 1e-9
                bx, by, bz = wx / norm - dx / length, wy / norm - dy / length, wz / norm - dz / length
                norm = math.sqrt(bx * bx + by * by + bz * bz) + 1e-9
                cosine = max((bx * nx + by * ny + bz * nz) / norm, 0.0)
                highlight = material[GLOSS] * 0.5 * cosine**40 * seen[r, number]
            for k in range(3):
                colours[r, k] += (albedo[k] + highlight) * lights[number, 4 + k] * arriving
        if material[EMISSION] > 0:
            for k in range(3):
                colours[r, k] = albedo[k] * material[EMISSION]
