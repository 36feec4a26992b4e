"""The training by the published definition: its drawing, its backward pass, its body and its growth, on the CPU."""

import numpy as np
import pytest
import torch

from gsac.avatar.body import Body as GsacBody
from gsac.benchmarks.gpu.published import formulas, splats
from gsac.benchmarks.gpu.published.body import Body
from gsac.benchmarks.gpu.published.compare import (
    FOCAL,
    FRAMES,
    HEIGHT,
    OPACITY,
    WIDTH,
    apart_of,
    compare_kernels,
    drawn_with_gradients,
    made_splats,
)
from gsac.benchmarks.gpu.published.scene import Scene, scene_of, task_of
from gsac.benchmarks.gpu.published.tiles import make_lists
from gsac.benchmarks.gpu.published.trainer import Trainer


def test_image_and_exact_gradient_are_autograds(monkeypatch):
    """With lists that reach as far as alpha does: 3DGS cuts them at three deviations."""
    radii = splats.radii
    monkeypatch.setattr(splats, "radii", lambda covariance: 2 * radii(covariance))
    parts, (background, by_image, by_alpha) = made_splats()
    found = drawn_with_gradients(parts, background, by_image, by_alpha, exact=True)
    wide = [part.double().requires_grad_() for part in parts]
    lens, images, alphas = torch.tensor([[FOCAL, FOCAL], [WIDTH / 2, HEIGHT / 2]]).double(), [], []
    for b in range(FRAMES):
        places, quats, scales, rgb, shift = wide[0][b], wide[1][b], wide[2][b], wide[3], wide[4][b]
        rgb, alpha = formulas.draw(places, quats, scales, rgb, OPACITY, *lens, (WIDTH, HEIGHT), shift)
        images.append(formulas.on_background(rgb[None], alpha[None], background[b:b + 1].double())[0])
        alphas.append(alpha)
    image, alpha = torch.stack(images), torch.stack(alphas)
    ((image * by_image).sum() + (alpha * by_alpha).sum()).backward()
    assert 0.2 < alpha.mean() < 0.8
    expected = image.detach(), alpha.detach(), *(leaf.grad for leaf in wide)
    assert all(apart_of(a, b) < 1e-5 for a, b in zip(found, expected, strict=True))


def test_the_published_backward_pass_takes_the_backgrounds_red_for_every_channel():
    parts, (background, by_image, by_alpha) = made_splats()
    published = drawn_with_gradients(parts, background, by_image, 0 * by_alpha, exact=False)
    red = background[:, :1].expand(FRAMES, 3)
    exact = drawn_with_gradients(parts, red, by_image, 0 * by_alpha, exact=True)
    assert all(torch.equal(a, b) for a, b in zip(published[2:], exact[2:], strict=True))
    assert apart_of(published[2], drawn_with_gradients(parts, background, by_image, 0 * by_alpha, exact=True)[2]) > 0.01


def test_the_published_backward_pass_has_its_own_slope_by_alpha():
    """One splat: its alpha for less light through, with the sign turned."""
    parts, (background, by_image, _) = made_splats(1)
    by_alpha = torch.zeros(FRAMES, HEIGHT, WIDTH)
    alpha = drawn_with_gradients(parts, background, 0 * by_image, by_alpha, exact=True)[1]
    at = (alpha[0] > 0.1).nonzero()[0].tolist()
    by_alpha[0, at[0], at[1]] = 1
    published, exact = (drawn_with_gradients(parts, background, 0 * by_image, by_alpha, exact)[6] for exact in (False, True))
    torch.testing.assert_close(published, -alpha[0, at[0], at[1]] * exact)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="the kernels need a GPU")
@pytest.mark.parametrize("exact", [False, True])
def test_the_kernels_are_their_plain_reference(exact):
    pytest.importorskip("triton")
    assert all(apart < 1e-5 for apart in compare_kernels(exact).values())


def test_a_tiles_list_has_the_splats_of_its_box_nearest_first():
    middle = torch.tensor([[[8.0, 8.0], [16.0, 8.0], [40.0, 30.0], [8.0, 8.0]]])
    lists = make_lists(middle, torch.tensor([[3.0, 3.0, 2.0, 0.0]]), torch.tensor([[2.0, 1.0, 1.5, 1.0]]), 48, 32)
    assert (lists.columns, lists.rows) == (3, 2)
    found = [lists.splat[a:b].tolist() for a, b in zip(lists.start, lists.start[1:], strict=False)]
    assert found == [[1, 0], [1], [], [], [], [2]]


def made_scene(body):
    """Two frames of a body in poses, and of grey persons, in squares of 64 px; a step sees both."""
    rng = np.random.default_rng(3)
    pose = rng.normal(0, 0.1, (2, 55, 3))
    pose[:, 0] += [np.pi, 0, 0]
    pose[:, 23:25] = 0
    pixels = np.zeros((2, 60, 40, 4), np.uint8)
    pixels[:, 10:50, 10:30] = [90, 120, 60, 255]
    arrays = dict(
        focal=(80, 80), centre=np.full((2, 2), (20, 30)), background=rng.random((400, 2, 3)), rgb=rng.random((len(body.faces), 3)),
        template=body.v_template, shapedirs=body.shapedirs, exprdirs=body.exprdirs, joints=body.J_regressor @ body.v_template,
        joint_dirs=np.einsum("jv,vck->jck", body.J_regressor, body.shapedirs), weights=body.weights, jaw_actions=body.jaw_actions,
        betas=rng.normal(0, 0.3, body.num_betas), pose=pose, transl=[[0, 0, 3], [0, 0.1, 3]],
        expression=rng.random((2, body.exprdirs.shape[2])))
    return Scene(side=np.array(64), corner=np.array([12, 2]), pixels=pixels, order=np.tile(np.int32([0, 1]), (400, 1)),
                 faces=body.faces.astype(np.int64), parents=np.array(body.parents),
                 **{name: np.asarray(value, np.float32) for name, value in arrays.items()})


def test_the_bodys_vertices_are_those_of_the_pipeline_and_a_scene_is_read_as_written(tmp_path):
    from gsac.avatar.body import BodyParams

    body = GsacBody.load()
    scene = made_scene(body)
    scene.write(tmp_path / "scene.npz")
    params = BodyParams.from_pose(scene.pose, scene.transl, scene.betas, scene.expression, 80.0, (20, 30))
    found = Body(Scene.read(tmp_path / "scene.npz")).vertices([1, 0]).detach().numpy()
    np.testing.assert_allclose(found, body.posed(params, [1, 0])[0], atol=2e-6)


def test_recipe_paper_starts_from_a_scene_as_the_scene_does():
    made = made_scene(GsacBody.load())
    scene = scene_of(task_of(made))
    again = scene_of(task_of(scene))
    assert scene.order.shape == (3000, 2) and scene.rgb.std() > 0.2 and scene.pixels[..., 3].any()
    np.testing.assert_allclose(scene.centre + scene.corner, made.centre + made.corner, atol=1e-5)
    for name, value in vars(scene).items():
        np.testing.assert_allclose(getattr(again, name), value, atol=1e-6, err_msg=name)


def test_gaussians_grow_with_empty_moments_and_only_frames_that_were_seen_move(monkeypatch):
    body = GsacBody.load()
    scene = made_scene(body)
    keep = np.arange(0, len(scene.faces), 300)
    count = len(keep)
    scene.faces, scene.rgb, scene.order = scene.faces[keep], scene.rgb[keep], np.zeros((400, 1), np.int32)
    scene.background = np.full((400, 1, 3), 0.5, np.float32)
    for name, value in {"FIRST": 0, "LAST": 4, "EVERY": 3}.items():
        monkeypatch.setattr(formulas, name, value)
    trainer = Trainer(scene, "cpu", masked=True, exact=False)
    with torch.no_grad():
        trainer.values["scale_logit"][:5] = -4.0  # small: cloned
    events, losses = [], []
    for step in range(4):
        losses.append(float(trainer.step(step)))
        if step == 2:  # only the first twenty are above the threshold
            trainer.total[20:] = 0
            trainer.total[:20] = 1.0
            trainer.times[:] = 2
        events.append(trainer.grow(step))
        if step == 2:
            moments = [state["exp_avg"] for state in map(trainer.adam.state.get, trainer.values.values())]
            assert not any(rows[count:].any() for rows in moments)
    assert events[0] is events[1] is events[3] is None and losses[-1] < losses[0]
    event = events[2]
    assert (event.before, event.above, event.cloned, event.split) == (count, 20, 5, 15)
    assert len(trainer.face) == count + 20 and trainer.face[count:].tolist() == list(range(20))
    assert (trainer.times <= 1).all() and trainer.times.any()  # anew since the event
    for name, value in trainer.values.items():
        state = trainer.adam.state[value]
        assert len(value) == count + 20 and int(state["step"]) == 4, name
    assert trainer.body.figure[0] in trainer.adam.state and trainer.body.figure[1] not in trainer.adam.state
