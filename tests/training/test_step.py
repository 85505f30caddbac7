"""One step: what moves, what does not, and the schedule."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from semgs.model.weights.initial_weights import initial_network
from semgs.training.schedule import Schedule
from semgs.training.state import TrainingState, training_step
from semgs.training.supervision.supervision import Pictures, make_supervision, render_targets
from semgs.training.training_settings import TrainingSettings


def begin(network, settings) -> TrainingState:
    return TrainingState.begin(network(), make_supervision(settings), settings.learning_rate, settings.average_decay)


def weights(state: TrainingState) -> torch.Tensor:
    return torch.nn.utils.parameters_to_vector(state.model.parameters()).detach().clone()


def test_three_steps_change_every_parameter_and_lower_the_loss_of_their_batch(network, batch, settings):
    state = begin(network, settings)
    before = {name: value.clone() for name, value in state.model.named_parameters()}
    totals = [training_step(state, [batch(0)], settings).total for _ in range(3)]
    assert all((value != before[name]).any() for name, value in state.model.named_parameters())
    assert totals[2] < totals[0]
    assert state.step == 3


def test_the_total_is_the_paper_s_plus_the_weighted_depth_term(network, batch, settings):
    report = training_step(begin(network, settings), [batch(1)], settings)
    expected = 0.5 * report.semantic + report.colour + 0.1 * report.smoothness + 0.1 * report.depth
    assert report.total == pytest.approx(expected, rel=1e-5)
    assert report.depth > 0
    without = replace(settings, depth_weight=0.0)
    off = training_step(begin(network, without), [batch(1)], without)
    assert off.depth == 0


def test_context_targets_render_the_contexts_after_the_targets(network, batch, settings):
    model, one = network(), batch(2)
    encoding = model(one.context)
    rendering, target = render_targets(encoding, one, context_targets=True)
    assert rendering.images.shape[1] == target.images.shape[1] == 4
    assert torch.equal(target.images, torch.cat((one.target.images, one.context.images), 1))
    assert torch.equal(target.cameras.centres, torch.cat((one.target.cameras.centres, one.context.cameras.centres), 1))
    rendering, target = render_targets(encoding, one)
    assert target is one.target
    assert rendering.images.shape[1] == 2


def test_a_gradient_longer_than_the_clip_is_shortened_to_it(network, batch, settings):
    state = begin(network, settings)
    report = training_step(state, [batch(3)], replace(settings, clip=1e-3))
    norm = torch.linalg.vector_norm(torch.cat([p.grad.flatten() for p in state.model.parameters()]))
    assert report.gradient_norm > 1e-2
    assert float(norm) == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.parametrize("broken", ["means", "depths"])
def test_a_step_that_is_not_finite_leaves_the_weights_and_is_counted(network, batch, settings, broken: str):
    state = begin(network, settings)
    for step in (0, 1):
        training_step(state, [batch(step)], settings)
    before, average = weights(state), [value.clone() for value in state.average.parameters()]
    # Only an average that differs from the weights could move towards them.
    assert not torch.equal(torch.nn.utils.parameters_to_vector(average), before)

    def break_it(module, inputs, encoding):
        if broken == "depths":
            return replace(encoding, depths=encoding.depths * math.nan)
        gaussians = encoding.gaussians
        return replace(encoding, gaussians=replace(gaussians, means=gaussians.means * math.nan))

    hook = state.model.register_forward_hook(break_it)
    assert not training_step(state, [batch(2)], settings).moved
    assert torch.equal(weights(state), before)
    assert all(torch.equal(a, b) for a, b in zip(average, state.average.parameters(), strict=True))
    assert (state.step, state.skipped, state.skipped_in_a_row) == (3, 1, 1)
    hook.remove()
    assert training_step(state, [batch(3)], settings).moved
    assert (state.skipped, state.skipped_in_a_row) == (1, 0)


def test_statistics_of_batch_norms_stay_in_a_step_that_is_not_finite_and_move_in_others(batch):
    model = initial_network("small", "small")
    state = TrainingState.begin(model, Pictures(), 1e-4, 0.99)
    schedule = Schedule(steps=9)
    before = {name: buffer.clone() for name, buffer in model.named_buffers()}
    one = batch(0)
    broken = one.context.images.clone()
    broken[..., 0, 0] = math.nan
    assert not training_step(state, [replace(one, context=one.context.changed(images=broken))], schedule).moved
    assert all(torch.equal(buffer, before[name]) for name, buffer in model.named_buffers())
    assert training_step(state, [one], schedule).moved
    assert all(buffer.isfinite().all() for buffer in model.buffers())
    last = "semantic.refinement.last.1.running_mean"
    assert not torch.equal(dict(model.named_buffers())[last], before[last])


def test_the_schedule_is_pytorch_s_one_cycle():
    parameter = torch.nn.Parameter(torch.zeros(1))
    optimizer = torch.optim.Adam([parameter])
    schedule = Schedule(steps=200, learning_rate=3e-3, warmup=0.05)
    theirs = torch.optim.lr_scheduler.OneCycleLR(optimizer, 3e-3, total_steps=200, pct_start=0.05, cycle_momentum=False)
    for step in range(200):
        assert schedule.rate(step) == pytest.approx(theirs.get_last_lr()[0], rel=1e-9)
        optimizer.step()
        if step < 199:
            theirs.step()


@pytest.mark.parametrize("steps", [1, 2, 5])
def test_the_schedule_of_a_tiny_run_is_finite_and_positive(steps: int):
    rates = [Schedule(steps=steps, learning_rate=1e-3).rate(step) for step in range(steps)]
    assert all(0 < rate <= 1e-3 for rate in rates)


def test_the_average_starts_at_the_weights_and_forgets_more_slowly_as_it_ages(network, batch, settings):
    state = begin(network, settings)
    training_step(state, [batch(0)], settings)
    first = weights(state)
    assert torch.equal(torch.nn.utils.parameters_to_vector(state.average.parameters()), first)
    training_step(state, [batch(1)], settings)
    second = weights(state)
    # The second update keeps (1 + 1) / (10 + 1) of the first.
    expected = first * (2 / 11) + second * (9 / 11)
    average = torch.nn.utils.parameters_to_vector(state.average.parameters())
    torch.testing.assert_close(average, expected)


def test_slow_parameters_move_by_their_share_of_the_rate_and_keep_their_moments_over_a_restart():
    settings = TrainingSettings(model="small_plain", steps=10, learning_rate=1e-3)

    def begun() -> TrainingState:
        torch.manual_seed(0)
        model = torch.nn.ModuleDict({name: torch.nn.Linear(1, 1, bias=False) for name in ("fast", "slow", "last")})
        return TrainingState.begin(model, make_supervision(settings), 1e-3, 0.9, rates={"slow.weight": 0.1})

    state = begun()
    before = {name: one.item() for name, one in state.model.named_parameters()}
    for parameter in state.model.parameters():
        parameter.grad = torch.ones_like(parameter)
    for group in state.optimizer.param_groups:
        group["lr"] = settings.rate(0) * group["relative_rate"]
    state.optimizer.step()
    # Adam's first step is the rate itself: 1e-3 / 25.
    moved = {name: before[name] - one.item() for name, one in state.model.named_parameters()}
    assert moved == pytest.approx({"fast.weight": 4e-5, "slow.weight": 4e-6, "last.weight": 4e-5}, rel=1e-2)
    state.optimizer.state[state.model["slow"].weight]["exp_avg"].fill_(7.0)
    again = begun()
    again.restore(state.tensors(), state.numbers())
    assert float(again.optimizer.state[again.model["slow"].weight]["exp_avg"]) == 7
    assert [group["relative_rate"] for group in again.optimizer.param_groups] == [1.0, 0.1]
