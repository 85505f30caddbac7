"""Make the images of the pages viewer, robots, recordings, export, mesh, poses, doctor and render, and photo_to_3d.gif of the README, from the included room.

python docs/page_pictures.py [NAME ...]

Needs the extras viewer, sfm, objects, mesh, raycast and dev, and Chromium for `viewer`.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial.transform import Rotation

from paper.release.demo import titled
from semgs import SavedScene, load, load_scene, occupancy, open_scene, refine
from semgs.data.demo_scene import demo_scene
from semgs.data.raycast import Raycaster
from semgs.export.scene_objects import place_things, things_of
from semgs.figures.class_images import class_picture, overlay
from semgs.figures.view_images import as_bytes
from semgs.files.images.colours import depth_limits, depth_picture, heat_picture
from semgs.geometry.camera_paths import orbit
from semgs.geometry.cameras import Cameras, back_project, project
from semgs.mesh.labelled import mesh_of
from semgs.rendering.rendering import confidence_maps, label_maps
from semgs.robotics.boxes import EDGES
from semgs.robotics.occupancy import FREE, OCCUPIED, UNKNOWN
from semgs.scene.upright import axis_direction, up_of, upright
from semgs.viewer.splat_groups import thing_colours
from semgs.viewer.viewer_page import scene_page

IMAGES = Path(__file__).parent / "images"
INPUTS = (5, 7)
QUALITY = 85
FLAGS = ("--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars")
WINDOW = (740, 1060)
"""(height, width) of the browser [px]."""

COLOURS, WORST_COLOUR = 128, 6.0
"""Of a GIF; and how far the mean colour of a class may be off, of 255."""

FEWEST_PIXELS = 30
"""Fewer pixels of a class cannot be seen."""

CELL = 6
"""Pixels of a cell of 5 cm in the floor plan."""

CONTENTS = {"free": (255, 255, 255), "occupied": (70, 70, 70), "unknown": (200, 200, 200)}
LETTERS = ImageFont.load_default(15)


def encoded(frames: tuple[int, ...] = INPUTS) -> SavedScene:
    """The room from some of its photos, as `semgs demo` makes it."""
    scene = open_scene(demo_scene())
    views = scene.read(frames)
    network = load("small")
    network.looks = 2
    return SavedScene.of(refine(network(views), views), views, unit=scene.unit)


def save(name: str, picture: np.ndarray) -> None:
    """Write an image, and print its size."""
    path = IMAGES / name
    Image.fromarray(picture).save(path, quality=QUALITY)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def viewer() -> None:
    """The page in 3D, in colour and as classes without walls."""
    from playwright.sync_api import sync_playwright

    shots = []
    photos = [as_bytes(image) for image in open_scene(demo_scene()).read(INPUTS).images]
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = Path(folder) / "scene.html"
        file.write_text(scene_page(replace(encoded(), source="demo"), photos).html)
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        page = playwright.chromium.launch(executable_path=program, args=list(FLAGS)).new_page(
            viewport={"width": WINDOW[1], "height": WINDOW[0]}
        )
        page.set_default_timeout(300_000)
        page.goto(file.as_uri())
        page.locator("body[data-ready]").wait_for()
        for step in (lambda: None, lambda: page.get_by_role("button", name="Classes").click()):
            step()
            page.wait_for_timeout(15_000)  # viser fades scenes in, which takes this long in software
            shot = Path(folder) / "shot.png"
            page.screenshot(path=shot)
            shots.append(np.asarray(Image.open(shot).convert("RGB").resize((WINDOW[1] * 7 // 10, WINDOW[0] * 7 // 10))))
        page.context.browser.close()
    save("viewer.jpg", np.hstack(shots))


def render() -> None:
    """What --show shows."""
    scene = encoded()
    seen = scene.render(scene.cameras[:1])
    labels = label_maps(seen)[0]
    image, depths = as_bytes(seen.images[0]), seen.depths[0].numpy()
    tiles = [image, overlay(image, labels, scene.classes), depth_picture(depths, depth_limits([depths]))]
    tiles.append(heat_picture(confidence_maps(seen)[0], (0.0, 1.0)))
    small = [np.asarray(Image.fromarray(tile).resize((256, 192))) for tile in tiles]
    save("render.jpg", titled(np.hstack(small), ("colour", "overlay", "depth", "confidence")))


def photo_to_3d() -> None:
    """A photo that becomes a scene: the camera moves, and colours become classes."""
    scene = encoded()
    photo = as_bytes(open_scene(demo_scene()).read(INPUTS[:1]).images[0])
    frames = [(photo, 1200)]
    start = scene.cameras[0]
    pivot = start.centres + 2.5 * start.world_from_camera[:3, 2]
    cameras = orbit(start, pivot, axis_direction("z"), 10.0, 24)
    seen = scene.render(cameras)
    labels = label_maps(seen)
    for index in range(24):
        image = as_bytes(seen.images[index])
        frames.append(
            (image if index < 12 else overlay(image, labels[index], scene.classes, min(1.0, (index - 11) / 4)), 110)
        )
    pictures = [Image.fromarray(frame).resize((240, 180)) for frame, _ in frames]
    found = [
        one.quantize(COLOURS, kmeans=1, dither=Image.Dither.NONE) for one in pictures
    ]  # each with a palette of its own
    check_colours(pictures[-1], found[-1].convert("RGB"), labels[-1])
    path = IMAGES / "photo_to_3d.gif"
    found[0].save(
        path, save_all=True, append_images=found[1:], duration=[time for _, time in frames], loop=0, optimize=True
    )
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def check_colours(picture: Image.Image, reduced: Image.Image, labels: np.ndarray) -> None:
    """Check that each class of a class map that can be seen keeps its colour with fewer colours: one palette for all frames turned chairs into the blue of cabinets.

    Raises:
        ValueError: one does not.
    """
    small = np.asarray(Image.fromarray(labels).resize(picture.size, Image.Resampling.NEAREST))
    for number in np.unique(small):
        shown = small == number
        if shown.sum() < FEWEST_PIXELS:
            continue
        before, after = (np.asarray(one)[shown].astype(float).mean(0) for one in (picture, reduced))
        if np.abs(before - after).max() > WORST_COLOUR:
            raise ValueError(f"class {number} is {before.round()} and becomes {after.round()}")


def robots() -> None:
    """The things in a photo, and beside it the floor plan with the same things from above."""
    scene = upright(encoded(tuple(range(8))), "z", "z").scene
    plan = occupancy(scene.gaussians, scene.cameras, classes=scene.classes, stride=scene.stride)
    cells = np.full((*plan.cells.shape, 3), CONTENTS["unknown"], np.uint8)
    cells[plan.cells == FREE], cells[plan.cells == OCCUPIED] = CONTENTS["free"], CONTENTS["occupied"]
    rows, columns = (slice(max(place.min() - 8, 0), place.max() + 9) for place in np.nonzero(plan.cells != UNKNOWN))
    corner = plan.origin[:2] + plan.resolution * np.array([columns.start, rows.start])
    above = Image.fromarray(cells[rows, columns][::-1])  # y is up
    above = above.resize((above.width * CELL, above.height * CELL), Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(above)

    def at(point: np.ndarray) -> tuple[float, float]:
        x, y = (point[:2] - corner) / plan.resolution * CELL
        return float(x), above.height - float(y)

    view = len(scene.cameras.centres) // 2
    photo = Image.fromarray(as_bytes(open_scene(demo_scene()).read([view]).images[0]))
    zoom = above.height / photo.height
    photo = photo.resize((round(zoom * photo.width), above.height), Image.Resampling.LANCZOS)
    lines = ImageDraw.Draw(photo)
    for one in place_things(things_of(scene, up_of(scene, "z"))):
        colour = tuple(thing_colours(np.array([one.thing.instance]))[0].tolist())
        base = one.corners[one.corners[:, 2] <= one.corners[:, 2].mean()]
        middle = base.mean(0)
        base = base[np.argsort(np.arctan2(*(base - middle)[:, :2].T))]
        draw.polygon([at(corner) for corner in base], outline=colour, width=4)
        name = f"{one.thing.instance} {one.thing.name}"
        label(draw, at(middle), str(one.thing.instance), colour)
        corners = project(torch.from_numpy(one.corners)[None], scene.cameras[view : view + 1])[0].numpy()
        if (corners[:, 2] < 0.1).any():
            continue
        for first, second in EDGES:
            lines.line([tuple(zoom * corners[place, :2]) for place in (first, second)], colour, width=3)
        x, y = zoom * corners[:, :2].mean(0)
        if 0 < x < photo.width and 0 < y < photo.height:
            label(lines, (float(x), float(y)), name, colour)
    for centre in scene.cameras.centres.numpy():
        x, y = at(centre)
        draw.ellipse((x - 4, y - 4, x + 4, y + 4), (30, 90, 220))
    sheet = Image.new("RGB", (photo.width + above.width + 10, above.height + 40), "white")
    sheet.paste(photo)
    sheet.paste(above, (photo.width + 10, 0))
    key, x = ImageDraw.Draw(sheet), photo.width + 10.0
    for name, colour in (*CONTENTS.items(), ("camera", (30, 90, 220))):
        key.rectangle((x, above.height + 13, x + 14, above.height + 27), colour, outline=(120, 120, 120))
        key.text((x + 20, above.height + 20), name, "black", font=LETTERS, anchor="lm")
        x += 40 + key.textlength(name, font=LETTERS)
    key.text((0, above.height + 20), "things in a photo, and from above", "black", font=LETTERS, anchor="lm")
    save("robots.png", np.asarray(sheet))


def label(draw: ImageDraw.ImageDraw, place: tuple[float, float], text: str, colour: tuple[int, ...]) -> None:
    """White letters on a plate of the colour."""
    left, top, right, bottom = draw.textbbox(place, text, font=LETTERS, anchor="mm")
    draw.rectangle((left - 4, top - 3, right + 4, bottom + 3), tuple(round(0.7 * one) for one in colour))
    draw.text(place, text, "white", font=LETTERS, anchor="mm")


def recordings() -> None:
    """What two photos show of the room, and what all eight show, from a place where no photo was taken."""
    two = encoded()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-m", "semgs", "reconstruct", str(demo_scene()), "--out", f"{folder}/all"], check=True
        )
        every = load_scene(f"{folder}/all")
    camera = two.cameras[:1]
    pose = camera.world_from_camera.clone()
    pose[0, :3, 3] -= 1.1 * pose[0, :3, 2]
    back = replace(camera, world_from_camera=pose)
    tiles = [as_bytes(scene.render(back).images[0]) for scene in (two, every)]
    save(
        "recordings.jpg",
        titled(
            np.hstack(tiles),
            ("two photos", "all eight photos"),
        ),
    )


def from_above(scene: SavedScene) -> Cameras:
    """A camera behind and above the first one, which looks at the middle of a scene."""
    up = axis_direction("z")
    middle = scene.gaussians.means.double().median(0).values
    forward = scene.cameras.world_from_camera[0, :3, 2]
    forward = forward - (forward @ up) * up
    eye = scene.cameras.centres[0] - 0.5 * forward / forward.norm() + 0.5 * up
    ahead = (middle - eye) / (middle - eye).norm()
    right = torch.linalg.cross(ahead, up)
    right = right / right.norm()
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = torch.stack((right, torch.linalg.cross(ahead, right), ahead), 1)
    pose[:3, 3] = eye
    return replace(scene.cameras[:1], world_from_camera=pose[None])


def export() -> None:
    """The files in colour and by class, from above."""
    scene = encoded(tuple(range(8)))
    seen = scene.render(from_above(scene))
    tiles = [as_bytes(seen.images[0]), class_picture(label_maps(seen)[0], scene.classes)]
    save("export.jpg", titled(np.hstack(tiles), ("gaussians.ply", "semantics.ply")))


def mesh() -> None:
    """The mesh with its colours, and its faces by class, from above."""
    scene = encoded(tuple(range(8)))
    surface = mesh_of(scene)
    camera = from_above(scene)
    ends = back_project(torch.ones(1, *camera.size, dtype=torch.float64), camera)[0].numpy()
    rays = (ends - camera.centres[0].numpy()).reshape(-1, 3)
    hits, _ = Raycaster(surface.vertices, surface.faces).cast(
        np.broadcast_to(camera.centres[0].numpy(), rays.shape), rays
    )
    corners = surface.vertices[surface.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    light = 0.55 + 0.45 * np.abs((across * rays[0]).sum(1)) / np.linalg.norm(across, axis=1) / np.linalg.norm(rays[0])
    table = np.array([*scene.classes.colours, *[(224, 224, 224)] * (256 - len(scene.classes))])
    by_class = table[surface.labels[surface.faces[:, 0]]] * light[:, None]
    tiles = [surface.colours[surface.faces].mean(1), by_class]
    drawn = [np.where(hits[:, None] >= 0, tile[hits], 255).reshape(*camera.size, 3).astype(np.uint8) for tile in tiles]
    save("mesh.jpg", titled(np.hstack(drawn), ("mesh.ply", "its classes")))


def doctor() -> None:
    """A view between the input views with right cameras, and with poses that lead from the world to the camera."""
    scene, network = open_scene(demo_scene()), load("small")
    tiles = [scene.read([6]).images[0]]
    for inverted in (False, True):
        views, photo = scene.read(INPUTS), scene.read([6])
        cameras, target = (
            replace(
                one, world_from_camera=torch.linalg.inv(one.world_from_camera) if inverted else one.world_from_camera
            )
            for one in (views.cameras, photo.cameras)
        )
        tiles.append(network(replace(views, cameras=cameras)).render(target).images[0])
    strip = np.hstack([as_bytes(tile) for tile in tiles])
    save("doctor.jpg", titled(strip, ("a photo between the input photos", "right poses", "inverted poses")))


def poses() -> None:
    """The cameras that `semgs poses` finds for the room's photos alone, after the best similarity, and the true ones, from above."""
    true = open_scene(demo_scene())
    with tempfile.TemporaryDirectory() as folder:
        photos, out = Path(folder) / "photos", Path(folder) / "out"
        shutil.copytree(demo_scene() / "images", photos)
        subprocess.run([sys.executable, "-m", "semgs", "poses", str(photos), "--out", str(out)], check=True)
        found = open_scene(out)
    by_name = {Path(frame.name).name: frame.world_from_camera for frame in true.frames}
    ours = np.stack([frame.world_from_camera for frame in found.frames])
    theirs = np.stack([by_name[Path(frame.name).name] for frame in found.frames])
    middles = ours[:, :3, 3].mean(0), theirs[:, :3, 3].mean(0)
    away = ours[:, :3, 3] - middles[0], theirs[:, :3, 3] - middles[1]
    turn = Rotation.align_vectors(theirs[:, :3, :2].mT.reshape(-1, 3), ours[:, :3, :2].mT.reshape(-1, 3))[0].as_matrix()
    scale = float((away[1] * (away[0] @ turn.T)).sum() / (away[0] ** 2).sum())
    placed = scale * away[0] @ turn.T + middles[1]
    errors = np.linalg.norm(placed - theirs[:, :3, 3], axis=-1)
    print(f"{len(placed)} of {len(by_name)} cameras, {100 * errors.mean():.1f} cm off in the mean")
    low, high = theirs[:, 1::-1, 3].min(0) - 0.3, theirs[:, 1::-1, 3].max(0) + 0.3
    zoom = 600 / float((high - low).max())
    sheet = Image.new("RGB", tuple((zoom * (high - low)).astype(int).tolist()), "white")
    draw = ImageDraw.Draw(sheet)

    def at(point: np.ndarray) -> tuple[float, float]:
        y, x = zoom * (point[:2] - low[::-1])
        return float(x), float(y)

    for centres, ahead, colour, radius in (
        (theirs[:, :3, 3], theirs[:, :3, 2], (40, 150, 80), 9),
        (placed, ours[:, :3, 2] @ turn.T, (220, 50, 40), 4),
    ):
        for centre, direction in zip(centres, ahead, strict=True):
            (x, y), tip = at(centre), at(centre + 0.25 * direction)
            draw.line((x, y, *tip), colour, 2)
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=colour, width=3)
    save(
        "poses.png",
        titled(np.asarray(sheet), ("green: true cameras; red: found from the photos alone",)),
    )


PICTURES = (viewer, render, photo_to_3d, robots, recordings, export, mesh, poses, doctor)


def main() -> None:
    """Make the images that are named, or all."""
    names = sys.argv[1:]
    for make in PICTURES:
        if not names or make.__name__ in names:
            make()


if __name__ == "__main__":
    main()
