"""Errors planted in `semgs/sources` and `semgs/segmenters`."""

from __future__ import annotations

from planted.mutant import Mutant


def of_segmenters(module: str, name: str) -> tuple[str, ...]:
    """A test of class maps and segmenters."""
    return (f"tests/segmenters/test_{module}.py::test_{name}",)


SEGMENTERS = (
    Mutant(
        "maps of distorted photos are taken for undistorted ones", "semgs/sources/photo_maps.py",
        "None if undistorted or frame.lens.is_pinhole else frame.lens.maps()", "None",
        ("tests/sources/test_photo_maps.py::test_a_map_that_tells_position_lands_where_the_photo_does",),
    ),
    Mutant(
        "maps are cropped from the corner", "semgs/sources/photo_maps.py",
        "[left : left + width]\n    return", "[:width]\n    return",
        ("tests/sources/test_photo_maps.py::test_a_crop_takes_the_middle_and_halves_are_normalised",),
    ),
    Mutant(
        "a pixel without a label is sure of the first class", "semgs/sources/photo_maps.py",
        "1 / classes, found)", "0.0, found)",
        ("tests/sources/test_photo_maps.py::test_a_pixel_without_label_is_even",),
    ),
    Mutant(
        "a segmenter votes against what it does not know", "semgs/segmenters/labelling.py",
        "torch.where(known[:, None, None], theirs_log, neutral)", "theirs_log",
        of_segmenters("labelling", "a_class_that_the_segmenter_cannot_say_gets_a_neutral_vote"),
    ),
    Mutant(
        "an exported network's mean is of pixels up to 1", "semgs/sources/network_files.py",
        "return (255 * offset, 255 * scale)", "return (offset, 255 * scale)",
        ("tests/segmenters/test_exported.py::test_logits_become_probabilities_by_softmax",),
    ),
    Mutant(
        "logits are normalised without an exponential", "semgs/segmenters/exported.py",
        "return values.softmax(0).numpy()", "return normalised(values).numpy()",
        ("tests/segmenters/test_exported.py::test_logits_become_probabilities_by_softmax",),
    ),
    Mutant(
        "an exported network's photo is sampled where it shrinks", "semgs/sources/network_files.py",
        "interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR", "interpolation=cv2.INTER_NEAREST",
        ("tests/segmenters/test_exported.py::test_a_larger_photo_is_averaged_by_area",),
    ),
    Mutant(
        "the zero point of quantised logits is ignored", "semgs/sources/runtimes.py",
        "(found.astype(np.float32) - self._zero) *", "found.astype(np.float32) *",
        ("tests/segmenters/test_exported.py::test_quantised_logits_are_converted_with_the_scale_and_zero_point_of_the_file",),
    ),
    Mutant(
        "scores of masks go through a softmax", "semgs/segmenters/huggingface.py",
        "(_shares(scores) if self.masks else scores.softmax(0))", "scores.softmax(0)",
        ("tests/segmenters/test_huggingface.py::test_models_with_masks_give_the_sum_over_masks_divided_by_that_over_classes",),
    ),
    Mutant(
        "none of these has a logit of 1", "semgs/segmenters/huggingface.py",
        "torch.zeros_like(found[:1])", "torch.ones_like(found[:1])",
        ("tests/segmenters/test_huggingface.py::test_other_text_prompted_models_can_be_used",),
    ),
    Mutant(
        "maps of other words are taken again", "semgs/segmenters/opening.py",
        "(stored.made_by, stored.classes.names) != (made_by, self.segmenter.classes.names)", "stored.made_by != made_by",
        ("tests/sources/test_cost.py::test_maps_of_another_network_or_of_other_classes_are_made_anew",),
    ),
    Mutant(
        "maps of another scene's photos are taken again", "semgs/segmenters/class_map_files.py",
        "self.earlier.photos.get(frame.name) != sha256_of(image)", "frame.name not in self.earlier.photos",
        ("tests/sources/test_cost.py::test_maps_of_other_photos_with_the_same_names_are_made_anew",),
    ),
    Mutant(
        "a feature of zeros takes an entry of the book", "semgs/segmenters/features/compression.py",
        "torch.where(length[:, 0] < SHORTEST, 0, nearest)", "nearest",
        ("tests/segmenters/features/test_compression.py::test_zero_stays_zero_and_a_book_goes_by_direction",),
    ),
    Mutant(
        "the energy that is kept is not about the mean", "semgs/segmenters/features/scene_features.py",
        "energy = self._count - float(self._sum.square().sum()) / max(1, self._count)", "energy = float(self._count)",
        ("tests/segmenters/features/test_scene_features.py::test_what_is_kept_and_the_bound_are_worked_out_by_hand",),
    ),
    Mutant(
        "a segmenter's labels are undistorted twice", "semgs/segmenters/relabelling.py",
        "replace(pixels, maps=None).taken", "pixels.taken",
        ("tests/segmenters/test_relabelling.py::test_labels_land_on_the_pixels_that_the_segmenter_saw_through_lens_and_crop",),
    ),
    Mutant(
        "a tie between classes is a label", "semgs/segmenters/relabelling.py",
        "(best >= confidence) & clear", "best >= confidence",
        ("tests/segmenters/test_relabelling.py::test_a_pixel_has_a_label_if_one_class_is_likely_enough_and_alone",),
    ),
)  # fmt: skip
