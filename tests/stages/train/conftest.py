"""A person small enough to train in seconds: the open body turning once, coloured by place, drawn by the z-buffer."""

from functools import partial

import numpy as np
import pytest

from gsac.avatar.artifacts import Clip
from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.cuda import why_not
from gsac.avatar.frame_files import write_alpha, write_frame
from gsac.avatar.light import FROM_CAMERA, shade
from gsac.avatar.zbuffer import interpolate, rasterise
from gsac.stages.contract import Job, make_config
from gsac.stages.train import STAGE

SIZE = (72, 128)
SMALL = {"gaussians": 900, "steps": 300, "height": 128, "holdout": 4, "pose_rate": 3e-3, "pose_test_steps": 10}


LAMP = np.array([[0.7, 0.7, 0.7], [0.35, 0.3, 0.3], [0, 0, 0], [0.2, 0.2, 0.2]])


def write_inputs(folder, frames=12, blank=(), timestamps=True, lamp=False):
    """The input ports of `train` in `folder`; frames named in `blank` get an empty mask. The fit is off by
    3 cm to the right and a third of a degree a joint. lamp: the person turns under LAMP, not in even light."""
    body, rng = Body.load(), np.random.default_rng(0)
    width, height = SIZE
    for name in ("split/frames", "segment/alpha", "smplx"):
        (folder / name).mkdir(parents=True)
    pose = np.zeros((frames, 55, 3))
    pose[:, 16, 2], pose[:, 17, 2] = -0.9, 0.9
    for t, yaw in enumerate(np.linspace(-np.pi, np.pi, frames, endpoint=False) + 0.1):
        pose[t, 0] = np.pi * np.array([np.cos(yaw / 2), 0, np.sin(yaw / 2)])
    transl = np.tile([0.0, 0.0, 4.4], (frames, 1))
    expression = np.zeros((frames, body.exprdirs.shape[2]))

    def params(pose, transl):
        made = BodyParams.from_pose(pose, transl, np.zeros(4), expression, 190.0, (36.0, 64.0), model=body.digest)
        made.joints = body.posed(made)[1]
        return made

    true = params(pose, transl)
    colours = 0.5 + 0.4 * np.sin(9 * body.v_template + [0.0, 1, 2])
    for t in range(frames):
        vertices = body.posed(true, [t])[0][0]
        face_id, bary, _ = rasterise(vertices, body.faces, true.camera(width, height))
        rgb = interpolate(colours, body.faces, face_id, bary)
        if lamp:
            factor = shade(LAMP, face_frames(vertices, body.faces).R[..., 1] * FROM_CAMERA)
            rgb = np.clip(rgb * factor[face_id], 0, 1)
        alpha = (face_id >= 0).astype(np.float32)
        write_frame(folder / f"split/frames/{t:06d}.png", np.uint8(np.where(alpha[..., None] > 0, rgb, 0.3) * 255))
        write_alpha(folder / f"segment/alpha/{t:06d}.exr", alpha * (t not in blank))
    stamps = [t / 30 for t in range(frames)] if timestamps else None
    Clip(30.0 if timestamps else None, stamps, width, height, None, "0" * 64).write(folder / "split/clip.json")
    shake = rng.normal(0, np.radians(0.3), pose.shape)
    shake[:, 22:] = 0
    params(pose + shake, transl + [0.03, 0, 0]).write(folder / "smplx/body.npz")
    return folder


@pytest.fixture
def job(tmp_path):
    """job(**parameters, frames=, blank=, lamp=, device=): a Job over fresh inputs; its warnings are in job.warnings."""
    def make(name="out", frames=12, blank=(), timestamps=True, lamp=False, device="cpu", **parameters):
        inputs = tmp_path / f"in_{frames}_{len(blank)}_{timestamps}_{lamp}"
        if not inputs.exists():
            write_inputs(inputs, frames, blank, timestamps, lamp)
        out = tmp_path / name
        out.mkdir()
        warnings = []
        made = Job({port: inputs / port for port in STAGE.inputs}, out, make_config(STAGE, SMALL | parameters),
                   warn=lambda finding: warnings.append(finding.message), device=device)
        made.warnings = warnings
        return made
    return make


gpu = pytest.mark.skipif(why_not() is not None, reason=f"CUDA path: {why_not()}")


@pytest.fixture(params=["cpu", pytest.param("cuda", marks=gpu)])
def job_anywhere(request, job):
    """As `job`, on the CPU, and on a GPU where there is one."""
    return partial(job, device=request.param)
