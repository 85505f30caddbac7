"""Errors planted in `semgs/scene`, in what it does without networks."""

from __future__ import annotations

from planted.mutant import Mutant

REFINEMENT = "semgs/scene/photo_refinement.py"
OF_REFINEMENT = "tests/scene/test_photo_refinement.py::test_"

VOTES = "semgs/run/steps/splat_labelling.py"
OF_VOTES = "tests/scene/test_pixel_votes.py::test_"

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
        "a held-out photo keeps its own mean", "semgs/scene/exposure.py",
        "+ drawn_mean[:, None, None]", "+ own_mean[:, None, None]",
        ("tests/scene/test_exposure.py::test_a_held_out_photo_gets_the_mean_and_deviation_of_its_rendering",),
    ),
    Mutant(
        "photos vote with the whole weight of a Gaussian", VOTES,
        "self.votes[seen] += logs[seen] / pixels[seen, None].sqrt()\n        self.weights[seen] += pixels[seen].sqrt()",
        "self.votes[seen] += logs[seen]\n        self.weights[seen] += pixels[seen]",
        (f"{OF_VOTES}pixels_of_a_photo_count_by_their_weights_and_photos_by_the_roots_of_theirs",),
    ),
    Mutant(
        "probabilities are summed, not their logs", VOTES,
        "(distributions + LEAST).log() * known", "(distributions + LEAST) * known",
        (f"{OF_VOTES}gaussians_collect_by_their_blending_weight",),
    ),
    Mutant(
        "pixels that say nothing vote", VOTES,
        "known = (distributions.sum(0, keepdim=True) > 0).to(distributions)", "known = torch.ones_like(distributions[:1])",
        (f"{OF_VOTES}pixels_of_zeros_say_nothing",),
    ),
    Mutant(
        "a Gaussian that no photo shows has the first class", "semgs/rendering/rendering.py",
        "torch.where(without_class(highest, distributions.shape[-1]), UNSEEN, labels)", "labels",
        ("tests/scene/test_confidence.py::test_a_gaussian_whose_classes_are_equally_likely_has_none",),
    ),
    Mutant(
        "colour Gaussians keep their size when they move in depth", "semgs/scene/photo_refinement.py",
        "start.colour.scales) * factors", "start.colour.scales)", ("tests/scene/test_photo_refinement.py::test_colour_gaussians_that_move_to_twice_the_depth_are_twice_as_large",),
    ),
    Mutant(
        "photos with almost no weight vote", "semgs/run/steps/splat_labelling.py",
        "LEAST_WEIGHT = 0.001", "LEAST_WEIGHT = 0.00001", ("tests/scene/test_pixel_votes.py::test_less_than_a_thousandth_of_a_pixel_is_no_vote",),
    ),
    Mutant(
        "channels without contrast have gains", "semgs/scene/exposure.py",
        "varied = (deviations >= FLATTEST).all(1)", "varied = torch.ones_like(deviations[:, 0], dtype=torch.bool)", ("tests/scene/test_exposure.py::test_a_channel_without_contrast_says_nothing_about_gains",),
    ),
)  # fmt: skip
