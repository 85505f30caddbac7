"""Labelled points from photos and a folder of depth maps of unknown scale, as another program writes it.

    python examples/depth_maps_in.py SCENE OUT

SCENE has measured depth: divided by 3, it plays the maps; otherwise it is only the truth. OUT gets points.ply and depth.jpg.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from semgs import SavedScene, load, open_scene
from semgs.data.choosing.choice import choose
from semgs.depth_maps.map_depth import find_reference, place_at_maps, read_maps
from semgs.depth_maps.opening import open_depth_maps
from semgs.export.points import make_points, save_points
from semgs.figures.view_images import as_bytes
from semgs.files.images.colours import depth_limits, depth_picture

measured, out = open_scene(sys.argv[1]), Path(sys.argv[2])
scene = replace(measured, frames=tuple(replace(frame, depth=None) for frame in measured.frames))
inputs = choose(scene, 2).context
views, truth = scene.read(inputs), measured.read(inputs).depths.numpy()
(out / "maps").mkdir(parents=True, exist_ok=True)
(out / "maps" / "depth.json").write_text('{"meaning": "scaled"}')  # depths up to a factor
for position, values in zip(inputs, truth, strict=True):
    np.save(out / "maps" / f"{Path(scene.frames[position].name).stem}.npy", values / 3)
source, without = open_depth_maps(str(out / "maps"))(scene), load("small")(views)
reference = find_reference(without, scene, inputs, views)
placed = place_at_maps(without, views, read_maps(source, scene, inputs, views.size), source, reference)[0]
for title, made in (("without", without), ("with", placed)):
    ratio = (made.depths.numpy() / truth)[truth > 0]
    scale = np.median(ratio)
    print(f"{title} the maps: shape {np.median(abs(ratio / scale - 1)):.1%} off, scale {scale - 1:+.1%}")
maps = [depth_picture(one[0], depth_limits(truth)) for one in (without.depths.numpy(), placed.depths.numpy(), truth)]
Image.fromarray(np.hstack([as_bytes(views.images[0]), *maps])).save(out / "depth.jpg", quality=85)
save_points(out / "points.ply", make_points(SavedScene.of(placed, views, unit=scene.unit)))  # labels in scalar_label
