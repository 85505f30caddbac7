"""Errors planted in `semgs/training`."""

from __future__ import annotations

from planted.mutant import Mutant

TRAINING = (
    Mutant(
        "images without cameras teach depth", "semgs/training/data/data_check/checks.py",
        "if not scene.posed and not learning.single_images:", "if not scene.posed and learning.single_images:",
        ("tests/training/data/test_images_without_cameras.py::test_any_other_supervision_refuses_them_by_name",),
    ),
    Mutant(
        "classes are counted in four images of hundreds", "semgs/training/data/data_check/counts.py",
        "FRAMES_COUNTED if scene.posed else len(scene)", "FRAMES_COUNTED",
        ("tests/training/data/test_images_without_cameras.py::test_classes_are_counted_in_every_image",),
    ),
    Mutant(
        "validation scores the mean of scenes for that of pixels", "semgs/training/supervision/validation.py",
        "counts if confusion is None else confusion + counts", "counts", ("tests/training/supervision/test_validation.py",),
    ),
    Mutant(
        "gradients of pieces are summed for averaged", "semgs/training/state.py",
        'terms["total"] / len(pieces)', 'terms["total"]', ("tests/training/test_processes.py",),
    ),
    Mutant(
        "processes exchange gradients after their first piece", "semgs/training/state.py",
        "enabled=piece is not pieces[-1]", "enabled=piece is not pieces[0]",
        ("tests/training/test_processes.py::test_processes_exchange_the_gradient_of_all_pieces_and_once",),
    ),
    Mutant(
        "the moving average moves on a skipped step", "semgs/training/state.py",
        "        state.average.update_parameters(state.model)\n    elif statistics:",
        "    state.average.update_parameters(state.model)\n    if not report.moved:",
        ("tests/training/test_step.py::test_a_step_that_is_not_finite_leaves_the_weights_and_is_counted",),
    ),
    Mutant(
        "all processes take the same scenes", "semgs/training/run/execution.py",
        "step * batch + self.rank * self.accumulate * each", "step * batch", ("tests/training/test_processes.py",),
    ),
    Mutant(
        "only the processes of one machine share a step", "semgs/training/run/execution.py",
        "self.devices * self.nodes, self.accumulate", "self.devices, self.accumulate", ("tests/training/run/test_execution.py",),
    ),
    Mutant(
        "validation uses the most input views of the training", "semgs/training/data/batches.py",
        "(fewest, _), targets = view_counts(", "(_, fewest), targets = view_counts(",
        ("tests/training/data/test_files.py::test_validation_rooms_have_the_fewest_input_views_of_the_training",),
    ),
    Mutant(
        "a mirrored camera keeps its principal point", "semgs/training/data/augmentation.py",
        "intrinsics[..., 0, 2] = width - intrinsics[..., 0, 2]", "pass", ("tests/training/data/test_augmentation.py",),
    ),
    Mutant(
        "a mirrored world keeps its poses", "semgs/training/data/augmentation.py",
        "poses = mirror @ views.cameras.world_from_camera @ mirror", "poses = views.cameras.world_from_camera",
        ("tests/training/data/test_augmentation.py",),
    ),
    Mutant(
        "a mirrored picture keeps its labels and depths", "semgs/training/data/augmentation.py",
        "views.map(lambda maps: maps.flip(-1), cameras=", "views.map(lambda maps: maps, lambda maps: maps.flip(-1), cameras=",
        ("tests/training/data/test_augmentation.py",),
    ),
    Mutant(
        "white balance changes as much as exposure", "semgs/training/data/augmentation.py",
        "rng.uniform(-strength, strength, 3) / 3", "rng.uniform(-strength, strength, 3)", ("tests/training/data/test_augmentation.py",),
    ),
    Mutant(
        "all views of a sample are exposed alike", "semgs/training/data/augmentation.py",
        "recolour(views.select([index]), strength, rng).images for index", "recolour(views.select([index]), strength, np.random.default_rng(0)).images for index",
        ("tests/training/data/test_augmentation.py",),
    ),
    Mutant(
        "samples from folders ignore the seed", "semgs/training/data/samples.py",
        "SeedSequence((self._seed, k, purpose))", "SeedSequence((0, k, purpose))",
        ("tests/training/data/test_files.py::test_another_seed_sees_other_scenes_and_frames",),
    ),
    Mutant(
        "a rolled camera turns against its image", "semgs/training/data/augmentation.py",
        "views.cameras.world_from_camera @ turn,", "views.cameras.world_from_camera @ turn.mT,",
        ("tests/training/data/test_augmentation.py",),
    ),
    Mutant(
        "a scene may end one round and begin the next", "semgs/training/data/samples.py",
        "range(gap - 1 if before else 0)", "range(0)", ("tests/training/data/test_single_pictures.py",),
    ),
    Mutant(
        "what a teacher does not speak of counts as uncertain", "semgs/training/data/teacher.py",
        "(terms * known).sum((-2, -1)) / known.sum((-2, -1)).clamp(min=1)", "terms.mean((-2, -1))",
        ("tests/training/data/test_teacher.py",),
    ),
    Mutant(
        "vignetting takes double from the corners", "semgs/training/data/photo_camera.py",
        "np.float32(loss / 2)", "np.float32(loss)", ("tests/training/data/test_photo_camera.py",),
    ),
    Mutant(
        "classes are brought to another table by position", "semgs/training/data/samples.py",
        "table.names.index(name) if name in table.names else IGNORE", "views.classes.names.index(name)",
        ("tests/training/data/test_files.py",),
    ),
    Mutant(
        "the moving average forgets as its weights should stay", "semgs/training/state.py",
        "torch._foreach_lerp_(averages, weights, 1 - now)", "torch._foreach_lerp_(averages, weights, now)",
        ("tests/training/test_step.py",),
    ),
    Mutant(
        "a resumed run has Adam begin anew", "semgs/training/state.py",
        '{"state": numbered, "param_groups"', '{"state": {}, "param_groups"', ("tests/training/test_loop.py",),
    ),
    Mutant(
        "a resumed run forgets its best score", "semgs/training/state.py",
        'float(numbers.get("best_score", -math.inf))', "-math.inf",
        ("tests/training/test_loop.py::test_a_run_that_goes_on_knows_the_best_score_of_before",),
    ),
    Mutant(
        "damaged checkpoints count among the last three", "semgs/training/run/checkpoints.py",
        "(record == own or _read_intact(record) is not None)", "True", ("tests/training/run/test_damage.py",),
    ),
    Mutant(
        "a run whose checkpoints are all damaged begins anew", "semgs/training/run/checkpoints.py",
        "    if damaged:\n", "    if False:\n", ("tests/training/run/test_damage.py",),
    ),
    Mutant(
        "losses compare clamped images", "semgs/training/supervision/supervision.py",
        "encoding.render(target.cameras, clamp=False)", "encoding.render(target.cameras)",
        ("tests/training/supervision/test_supervision.py::test_a_pixel_that_is_too_bright_is_compared_as_bright_as_it_is",),
    ),
    Mutant(
        "a run that was made longer is made shorter again", "semgs/training/run/run_folder.py",
        "if settings.steps > there.steps:", "if settings.steps != there.steps:", ("tests/training/run/test_run_folder.py",),
    ),
    Mutant(
        "a rate of zero still learns", "semgs/training/state.py",
        "if rates.get(name, 1.0) > 0}", "}",
        ("tests/training/supervision/test_supervision.py::test_a_rate_of_zero_freezes_what_it_is_for_and_nothing_else",),
    ),
)  # fmt: skip
