"""The whole picture against a loop over pixels and Gaussians in plain numbers."""

from __future__ import annotations

import math

import pytest
import torch
from scipy.spatial.transform import Rotation

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.harmonics import basis
from semgs.rendering.render import render

SIZE = (7, 11)
NEAR = 1.0
BACKGROUND = (0.2, 0.5, 0.7)


def ellipse(mean, appearance: Appearance, index: int, camera: Cameras) -> tuple[float, float, float, torch.Tensor]:
    """(u, v, z) of a Gaussian, and its covariance in the picture with 0.3 px^2 on the diagonal."""
    pose, k, (height, width) = camera.world_from_camera, camera.intrinsics, camera.size
    (fx, _, cx), (_, fy, cy) = k[0].tolist(), k[1].tolist()
    x, y, z = (pose[:3, :3].T @ (mean - pose[:3, 3])).tolist()
    # The Jacobian sees the position no further out than 15 % of the image beside it.
    sx = min(max(x / z, (-0.15 * width - cx) / fx), (1.15 * width - cx) / fx)
    sy = min(max(y / z, (-0.15 * height - cy) / fy), (1.15 * height - cy) / fy)
    jacobian = torch.tensor([[fx / z, 0, -fx * sx / z], [0, fy / z, -fy * sy / z]], dtype=torch.float64)
    w, *xyz = appearance.quaternions[index].tolist()
    r = torch.from_numpy(Rotation.from_quat([*xyz, w]).as_matrix())
    s = torch.diag(appearance.scales[index])
    flat = jacobian @ pose[:3, :3].T @ r @ s
    return fx * x / z + cx, fy * y / z + cy, z, flat @ flat.T + 0.3 * torch.eye(2, dtype=torch.float64)


def blended(gaussians: Gaussians, appearance: Appearance, features: list, camera: Cameras) -> tuple[torch.Tensor, ...]:
    """sum_i w_i f_i and the transmittance of every pixel, front to back."""
    height, width = camera.size
    drawn = [(i, *ellipse(gaussians.means[i], appearance, i, camera)) for i in range(len(gaussians))]
    drawn = sorted((one for one in drawn if one[3] > 0.2 * NEAR), key=lambda one: one[3])
    picture = torch.zeros(height, width, len(features[0]), dtype=torch.float64)
    light = torch.ones(height, width, dtype=torch.float64)
    for row in range(height):
        for column in range(width):
            t = 1.0
            for i, u, v, _, matrix in drawn:
                d = torch.tensor([column + 0.5 - u, row + 0.5 - v], dtype=torch.float64)
                sigma = 0.5 * float(d @ torch.linalg.inv(matrix) @ d)
                alpha = min(0.999, float(gaussians.opacities[i]) * math.exp(-sigma))
                if alpha < 1 / 255:
                    continue
                if t * (1 - alpha) <= 1e-4:
                    break
                picture[row, column] += alpha * t * torch.tensor(features[i], dtype=torch.float64)
                t *= 1 - alpha
            light[row, column] = t
    return picture, light


@pytest.mark.long
@pytest.mark.parametrize("backend", ["reference", "numba"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_picture_equals_a_loop_over_pixels_and_gaussians(random_scene, seed: int, backend: str) -> None:
    gaussians, cameras = random_scene(seed, count=60, views=2, size=SIZE, harmonics=9, classes=4)
    gaussians.opacities[:30] = 0.9995
    gaussians.colour.scales[:30] *= 3
    found = render(gaussians, cameras, background=BACKGROUND, near=NEAR, backend=backend, clamp=False)
    for view in range(2):
        camera = cameras[view]
        centre, axis = camera.centres, camera.world_from_camera[:3, 2]
        features = []
        for i in range(len(gaussians)):
            offset = gaussians.means[i] - centre
            weights = basis(offset / offset.norm(), 2)
            colour = (0.5 + (weights[:, None] * gaussians.colour.features[i]).sum(0)).clamp(min=0)
            features.append([*colour.tolist(), float(offset @ axis)])
        picture, light = blended(gaussians, gaussians.colour, features, camera)
        image = picture[..., :3] + light[..., None] * torch.tensor(BACKGROUND, dtype=torch.float64)
        assert torch.allclose(found.images[view], image.permute(2, 0, 1), rtol=0, atol=1e-10)
        assert torch.allclose(found.alphas[view], 1 - light, rtol=0, atol=1e-10)
        depth = torch.where(light < 1, picture[..., 3] / (1 - light).clamp(min=1e-12), 0)
        assert torch.allclose(found.depths[view], depth, rtol=0, atol=1e-10)
        classes, left = blended(gaussians, gaussians.semantic, gaussians.semantic.features.tolist(), camera)
        assert torch.allclose(
            found.semantics[view], (classes + left[..., None] / 4).permute(2, 0, 1), rtol=0, atol=1e-10
        )
        assert light.min() < 2e-3  # some pixels are finished before their last Gaussian
        assert (light > 0.5).any()
