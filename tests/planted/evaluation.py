"""Errors planted in `semgs/evaluation`."""

from __future__ import annotations

from planted.mutant import Mutant

EVALUATION = (
    Mutant(
        "single images have the temperature of rendered pixels", "semgs/evaluation/single_images.py",
        "network.temperatures.gaussians", "network.temperatures.rendered",
        ("tests/evaluation/test_single_images.py::test_the_temperature_of_single_gaussians_changes_confidence_alone",),
    ),
    Mutant(
        "images of the same name share a file of classes", "semgs/evaluation/frames/frame_plan.py",
        "numbered[position] if alike[stem] > 1 else stem", "stem",
        ("tests/evaluation/frames/test_plan.py::test_targets_with_one_file_name_as_in_a_rig_get_their_positions_before_it",),
    ),
    Mutant(
        "all photos count as one scene for intervals", "semgs/evaluation/single_images.py",
        'scene=scene.name if scene.posed else f"{scene.name}/{stem}"', "scene=scene.name",
        ("tests/evaluation/test_single_images.py::test_each_image_without_a_camera_counts_as_a_scene",),
    ),
    Mutant(
        "mean IoU of images is that of their sum", "semgs/evaluation/scoring/summary.py",
        "each, shown = torch.from_numpy(confusions),", "each, shown = torch.from_numpy(0 * confusions + confusions.sum(0)),",
        ("tests/evaluation/scoring/test_summary.py",),
    ),
    Mutant(
        "GSNeRF's distance takes R for its transpose", "semgs/evaluation/frames/protocols.py",
        '-np.einsum("nji,nj->ni"', '-np.einsum("nij,nj->ni"', ("tests/evaluation/frames/test_protocols.py",),
    ),
    Mutant(
        "unseen pixels count for the calibration", "semgs/evaluation/scoring/frame_scores.py",
        "(labels != IGNORE) & (prediction.confidences > 0)", "labels != IGNORE",
        ("tests/evaluation/scoring/test_frame_scores.py::test_only_labelled_and_seen_pixels_count_for_the_confidence",),
    ),
)  # fmt: skip
