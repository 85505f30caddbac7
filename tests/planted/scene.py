"""Errors planted in `semgs/scene`, in what it does without networks."""

from __future__ import annotations

from planted.mutant import Mutant

REFINEMENT = "semgs/scene/photo_refinement.py"
OF_REFINEMENT = "tests/scene/test_photo_refinement.py::test_"

SCENE = (
    Mutant(
        "numbers that step together have a second moment each", REFINEMENT,
        "square.mean() if self.together else square", "square",
        (f"{OF_REFINEMENT}steps_are_adams",),
    ),
    Mutant(
        "the rate does not fall", REFINEMENT,
        "self.value -= factor * self.rate", "self.value -= self.rate",
        (f"{OF_REFINEMENT}a_step_at_half_the_rate_is_half_as_long",),
    ),
    Mutant(
        "depths stay where the Gaussians were", REFINEMENT,
        "depths = start.depths * start.per_pixel(ratios)", "depths = start.depths",
        (f"{OF_REFINEMENT}depths_follow_the_gaussians_and_class_gaussians_grow_with_them",),
    ),
    Mutant(
        "Gaussians of a walk are those of the first photos", REFINEMENT,
        "self._blocks = encoding.blocks.to(", "self._blocks = torch.arange(len(gaussians)).to(",
        (f"{OF_REFINEMENT}gaussians_of_merged_windows_know_their_photos",),
    ),
    Mutant(
        "a sensor's Gaussians move", REFINEMENT,
        "        if self._moves:\n            factors", "        if True:\n            factors",
        (f"{OF_REFINEMENT}gaussians_that_a_sensor_placed_do_not_move",),
    ),
    Mutant(
        "the last pass is kept", REFINEMENT,
        "if curve[-1] > max(curve[:-1]):", "if True:",
        (f"{OF_REFINEMENT}a_scene_that_only_gets_worse_stays_as_it_was",),
    ),
    Mutant(
        "the order of the photos is always the same", REFINEMENT,
        "torch.Generator().manual_seed(seed)", "torch.Generator().manual_seed(0)",
        (f"{OF_REFINEMENT}the_same_seed_gives_the_same_bits",),
    ),
    Mutant(
        "exposure has no offset", REFINEMENT,
        "offset = photo.mean(1) - gain * image.mean(1)", "offset = torch.zeros_like(gain)",
        (f"{OF_REFINEMENT}a_darker_photo_is_fitted_with_gain_and_offset",),
    ),
)  # fmt: skip
