"""Your own photos: open a scene, choose input views, reconstruct, and look at it from between them.

    python examples/own_photos.py SCENE OUT

SCENE is anything that `semgs reconstruct` reads. OUT gets scene.ply for splat viewers, and views.jpg with two photos
and the view between them.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from semgs import load, open_scene, save_ply
from semgs.data.choosing.choice import choose
from semgs.figures.class_images import class_picture
from semgs.figures.view_images import as_bytes
from semgs.files.images.colours import depth_limits, depth_picture

scene, out = open_scene(sys.argv[1]), Path(sys.argv[2])
choice = choose(scene, 2)  # the pair that overlaps and has a baseline
views = scene.read(choice.context, depth_range=choice.depth_range)
target = scene.read(choice.targets[:1], views.size)  # a photo that the network does not see

encoding = load("small")(views)
rendering = encoding.render(target.cameras)  # .images .semantics .depths .alphas

out.mkdir(parents=True, exist_ok=True)
save_ply(out / "scene.ply", encoding.gaussians)
depths, labels = rendering.depths[0].numpy(), rendering.semantics[0].argmax(0).byte().numpy()
photos = [as_bytes(image) for image in (*views.images, *rendering.images)]
maps = [class_picture(labels, encoding.classes), depth_picture(depths, depth_limits(depths))]
Image.fromarray(np.hstack([*photos, *maps])).save(out / "views.jpg")
print(
    f"{out}: {len(encoding.gaussians):,} Gaussians; views.jpg: two input views; render, classes and depth between them"
)
