"""Arrays in memory: photos, poses and intrinsics from a robot or another library.

    python examples/arrays_in.py SCENE OUT.jpg

SCENE is a folder with a transforms.json. Its poses have OpenGL axes and become arrays, as your program may have them.
"""

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from semgs import Views, load
from semgs.figures.view_images import as_bytes
from semgs.files.images.colours import depth_limits, depth_picture

folder, used = Path(sys.argv[1]), (2, 5)
scene = json.loads((folder / "transforms.json").read_text())
frames = [scene["frames"][number] for number in used]

images = np.stack([np.array(Image.open(folder / frame["file_path"])) for frame in frames])  # RGB, uint8 [v h w 3]
opengl = np.array([frame["transform_matrix"] for frame in frames])  # camera to world: x right, y up, z backward
world_from_camera = opengl @ np.diag([1, -1, -1, 1])  # OpenCV: x right, y down, z forward
intrinsics = np.array([[scene["fl_x"], 0, scene["cx"]], [0, scene["fl_y"], scene["cy"]], [0, 0, 1]])  # [px]

views = Views.from_arrays(images, world_from_camera, intrinsics, depth_range=(0.5, 10.0))
encoding = load("small")(views)

moved = world_from_camera[:1].copy()
moved[:, :3, 3] += 0.1 * moved[:, :3, 0]  # 10 cm to the right
camera = Views.from_arrays(images[:1], moved, intrinsics, depth_range=(0.5, 10.0)).cameras
rendering = encoding.render(camera)
depth = rendering.depths[0].numpy()  # float32 [h w], along the optical axis [m]

shown = [images[0], as_bytes(rendering.images[0]), depth_picture(depth, depth_limits(depth))]
Image.fromarray(np.hstack(shown)).save(sys.argv[2])
print(f"{sys.argv[2]}: the first photo; the view 10 cm to its right; depth there, median {np.median(depth):.2f} m")
