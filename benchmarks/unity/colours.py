"""python -m gsac.benchmarks.unity.colours: how near a project with linear colours comes to the trained picture, in several ways.

The trained picture composites display colours. Over backgrounds from black to white, on the software GPU, of each avatar:

direct   the splats as one draw among the transparent things, their colours made linear: what costs nothing
refitted the same after colours and opacities were fitted once more to the trained picture under linear blending
own      the splats composited in display colours in a picture of its own, laid over the scene without knowing what lies there
behind   the same, with a copy of what lies behind
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gsac.avatar import light
from gsac.avatar.binding import Bound, bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.raster import render, render_bound, render_bound_backward
from gsac.avatar.rotation import exp
from gsac.avatar.srgb import to_display, to_linear
from gsac.benchmarks.unity.frame import draw_rule, index_bits
from gsac.benchmarks.unity.gpu import Gpu, Painting, projection
from gsac.benchmarks.unity.shaders import CORE, STEREO, compile_pass, shader_passes
from gsac.benchmarks.unity.spirv import Program

BACKGROUNDS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Display values of a grey background."""
WAYS = ("direct", "refitted", "own", "behind")
APART = 0.032
"""m, of each of a headset's eyes from their middle."""
EDGE = 0.02
"""Least alpha of a pixel of the person."""
BEHIND = {"": "GsacBehind", "UniversalPipeline": "_CameraOpaqueTexture", "HDRenderPipeline": "_ColorPyramidTexture"}
"""Render pipeline -> the shader's name of the copy of what lies behind."""


class Shot(NamedTuple):
    """A person before a camera, in its frame (y down)."""

    vertices: np.ndarray
    """(V, 3) m."""
    camera: Camera


class Programs(NamedTuple):
    """Compiled (vertex, fragment) passes of a render pipeline."""

    direct: tuple[Program, Program]
    own: tuple[Program, Program]
    laid: tuple[Program, Program]
    behind: str


def compile_programs(pipeline: str, *stand_ins: Path) -> Programs:
    """Compiles what draws the splats in a pipeline. stand_ins: folders of stand-ins for the pipeline's files."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        own = compile_pass(shader_passes(CORE / "GsacOwn.shader")[""], folder, *stand_ins, entries=("OwnVertex", "OwnFragment"))
        direct, laid = (compile_pass(shader_passes(CORE / f"{shader}.shader")[pipeline], folder, *stand_ins)
                        for shader in ("GsacSplats", "GsacTrained"))
    return Programs(direct, own, laid, BEHIND[pipeline])


class Stage:
    """A target with linear colours, in which a person is drawn over a grey background by the package's shaders."""

    def __init__(self, gpu: Gpu, programs: Programs, avatar: RiggedAvatar, size: int, eyes: int = 1) -> None:
        """eyes: 2 of a headset, whose programs were compiled with `shaders.STEREO` before the other stand-ins."""
        self.gpu, self.programs, self.avatar, self.size, self.eyes = gpu, programs, avatar, size, eyes
        count = len(avatar.gaussians)
        self.direct = Painting(gpu, *programs.direct, size, size, count, depth=True)
        self.own = Painting(gpu, *programs.own, eyes * size, size, count, ("rgba16float", "r16float"))
        self.laid = Painting(gpu, *programs.laid, size, size, 1, depth=True)
        gpu.put("GsacLatest", np.zeros(1, np.uint32))
        gpu.textures |= {"GsacTrained": self.own.targets[0], "GsacTrainedDepth": self.own.targets[1]}

    def put(self, shot: Shot, g: Gaussians) -> None:
        """Uploads the gaussians of a shot, bound, lit and sorted."""
        bound, shade = bind_shot(shot, self.avatar.faces, g)
        half = bound.rotations * bound.scales[:, None]
        c = half @ half.transpose(0, 2, 1)
        splats = np.concatenate([bound.means, c[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], shade], 1)
        self.gpu.put("GsacSplats", splats.astype(np.float32))
        self.gpu.put("GsacColours", np.concatenate([g.rgb, g.opacity[:, None]], 1).astype(np.float32))
        self.gpu.put("GsacKeys", np.argsort(-bound.means[:, 2], kind="stable").astype(np.uint32))

    def seen_by(self, shot: Shot, eye: int) -> Shot:
        """The shot in the frame of one of the eyes."""
        return shot._replace(vertices=shot.vertices - self.places[eye].astype(np.float32))

    @property
    def places(self) -> np.ndarray:
        """(2, 3) m, of the eyes; a camera's only one twice."""
        return np.array([[-APART, 0, 0], [APART, 0, 0]]) if self.eyes == 2 else np.zeros((2, 3))

    def parameters(self, shot: Shot, linear: int, eye: int = 0) -> dict:
        """Of a draw; linear: whether the splats' colours are to be made linear."""
        camera, g = shot.camera, self.avatar.gaussians
        flip = np.diag([1.0, -1, -1])
        views = [np.block([[flip, -flip @ place[:, None]], [np.zeros(3), 1]]) for place in self.places]
        relative = self.programs.behind == BEHIND["HDRenderPipeline"]
        P, screen = projection(camera), [self.size, self.size, 0, 0]
        return {"unity_MatrixV": views[0].T, "glstate_matrix_projection": P.T,
                "_ScreenParams": screen, "_ScaledScreenParams": screen,
                "unity_StereoMatrixV": [np.diag([1.0, -1, -1, 1]) if relative else view.T for view in views],
                "unity_StereoMatrixP": [P.T, P.T], "_XRWorldSpaceCameraPos": np.column_stack([self.places, [0, 0]]),
                "_ScreenSize": screen, "_WorldSpaceCameraPos": [0, 0, 0, 0], "GsacEyeView": views[eye].T,
                "TestFog": [0, 0, 0, 0], "_InvViewProjMatrix": np.eye(4),
                "GsacEyeProjection": projection(camera, flipped=True).T, "GsacEyeScreen": [self.size, self.size, 2, 1],
                "GsacParts": self.eyes, "GsacEyePlace": np.column_stack([self.places, [0, 0]]),
                "GsacEyeRect": [[-1, -1, 1, 1]] * 2, "GsacEyeLens": [[P[0, 0], P[1, 1], P[0, 2], P[1, 2]]] * 2,
                "GsacIndexBits": index_bits(len(g)), **draw_rule(g.low_pass, linear),
                **{f"GsacModel{r}": np.eye(4)[r] for r in range(3)}}

    def draw_direct(self, shot: Shot, background: float, eye: int = 0) -> np.ndarray:
        """Display values (size, size, 3) of the splats as one draw over a background."""
        grey = float(to_linear(np.asarray(background)))
        return to_display(self.direct.draw(self.parameters(shot, 1), instance=eye, behind=(grey, grey, grey, 1))[..., :3])

    def draw_own(self, shot: Shot) -> None:
        """Draws the person's own picture, an eye's part after the other's."""
        for eye in range(self.eyes):
            self.own.draw(self.parameters(shot, 0, eye), parts=self.eyes, part=eye)

    def lay(self, shot: Shot, background: float, known: bool, far: float = 1, eye: int = 0, room: bool = False) -> np.ndarray:
        """Display values (size, size, 3) of the own picture laid over a background. far: depth of what stands in the scene.

        Of a headset's copy of what lies behind, the other eye's slice is black; room: all of it is, where the real room is seen.
        """
        grey = float(to_linear(np.asarray(background)))
        side = self.size if known else 4
        slices = self.eyes if self.copy_kind == "texture-array" else 1
        copy, texels = self.gpu.texture(side, side, "rgba16float", slices), np.zeros((slices, side, side, 4), np.float16)
        texels[min(eye, slices - 1)] = (0, 0, 0, 0) if room else (grey, grey, grey, 1)
        self.gpu.device.queue.write_texture({"texture": copy}, texels, {
            "bytes_per_row": side * 8, "rows_per_image": side}, (side, side, slices))
        self.gpu.textures[self.programs.behind] = copy
        parameters = self.parameters(shot, 0) | {"GsacBehindIsCopied": int(known)}
        return to_display(self.laid.draw(parameters, instance=eye, behind=(grey, grey, grey, 1), far=far)[..., :3])

    @property
    def copy_kind(self) -> str:
        """Of the binding of what lies behind: `texture`, or a headset's `texture-array`."""
        return next(kind for kind, name in self.programs.laid[1].bindings.values() if name == self.programs.behind)


def bind_shot(shot: Shot, faces: np.ndarray, g: Gaussians) -> tuple[Bound, np.ndarray]:
    """The gaussians of a shot in the camera's frame, and (N, 3) factors of their colours. faces: (F, 3)."""
    frames = face_frames(shot.vertices.astype(np.float64), faces)
    bound = bind(frames, g.face, g.mu, g.quat, g.log_scale)
    normals = frames.R[g.face, :, 1] * light.FROM_CAMERA
    return bound, np.ones((len(g), 3)) if g.light is None else light.shade(g.light, normals)


def trained_picture(shot: Shot, faces: np.ndarray, g: Gaussians) -> tuple[np.ndarray, np.ndarray]:
    """The trainer's picture: premultiplied display colours (H, W, 3) and alpha (H, W). faces: (F, 3)."""
    bound, shade = bind_shot(shot, faces, g)
    got = render(bound.means.astype(np.float32), bound.rotations.astype(np.float32), bound.scales.astype(np.float32),
                 (g.rgb * shade).astype(np.float32), g.opacity, shot.camera, low_pass=g.low_pass)
    return got.rgb.copy(), got.alpha.copy()


def make_shots(avatar: RiggedAvatar, size: int, count: int, seed: int) -> list[Shot]:
    """Random moments of the avatar's motions from random sides; the person fills nine tenths of the height."""
    rng, height = np.random.default_rng(seed), float(np.ptp(avatar.vertices[:, 1]))
    middle = np.array([0, avatar.ground + height / 2, 0])
    away = 1.75 * height
    focal, shots = .9 * size * away / height, []
    for _ in range(count):
        clip = list(avatar.clips.values())[rng.integers(len(avatar.clips))]
        pose = np.zeros((len(avatar.joints), 3), np.float32)
        pose[[avatar.joint_names.index(name) for name in clip.joints]] = clip.rotation[rng.integers(len(clip.rotation))]
        turn = np.diag([1.0, -1, -1]) @ exp(np.array([0, rng.uniform(-np.pi, np.pi), 0]))
        shots.append(Shot(((avatar.posed(pose) - middle) @ turn.T + [0, 0, away]).astype(np.float32),
                          Camera((focal, focal), (size / 2, size / 2), size, size)))
    return shots


def refit(avatar: RiggedAvatar, size: int = 320, steps: int = 200, rate: float = .01) -> Gaussians:
    """The gaussians with colours and opacities whose linear blending comes nearest to the trained picture, by Adam."""
    g, rng = avatar.gaussians, np.random.default_rng(0)
    given = np.clip(g.opacity, 1e-3, .9985)
    values = np.column_stack([g.rgb, np.log(given / (1 - given)) / 5]).astype(np.float64)
    mean, square = np.zeros_like(values), np.zeros_like(values)
    for step, shot in enumerate(make_shots(avatar, size, steps, 1)):
        trained, alpha = trained_picture(shot, avatar.faces, g)
        background = rng.uniform(0, 1, 3)
        opacity, shade = 1 / (1 + np.exp(-5 * values[:, 3])), bind_shot(shot, avatar.faces, g)[1]
        shown = values[:, :3] * shade
        fitted = replace(g, rgb=to_linear(shown).astype(np.float32), opacity=opacity.astype(np.float32), light=None)
        got = render_bound(shot.vertices, avatar.faces, fitted, shot.camera)
        linear = got.rgb + (1 - got.alpha[..., None]) * to_linear(background)
        off = to_display(linear) - trained - (1 - alpha[..., None]) * background
        slope = np.where(linear > .0031308, 1.055 / 2.4 * np.maximum(linear, .003) ** (1 / 2.4 - 1), 12.92)
        grad = (off * slope / (alpha > EDGE).sum()).astype(np.float32)
        back = render_bound_backward(got.state, grad, -(grad * to_linear(background)).sum(-1).astype(np.float32))
        rise = np.where(shown > .04045, 2.4 / 1.055 * ((np.maximum(shown, .04) + .055) / 1.055) ** 1.4, 1 / 12.92)
        slopes = np.column_stack([back.rgb * rise * shade, 5 * back.opacity * opacity * (1 - opacity)])
        mean, square = .9 * mean + .1 * slopes, .99 * square + .01 * slopes ** 2
        along = mean / (1 - .9 ** (step + 1)) / (np.sqrt(square / (1 - .99 ** (step + 1))) + 1e-12)
        values -= rate * (.05 + .475 * (1 + np.cos(np.pi * step / steps))) * along
        values[:, :3] = np.maximum(values[:, :3], 0)
    return replace(g, rgb=values[:, :3].astype(np.float32), opacity=(1 / (1 + np.exp(-5 * values[:, 3]))).astype(np.float32))


def decibels(got: np.ndarray, want: np.ndarray, where: np.ndarray) -> float:
    """PSNR in the pixels of `where`. got, want: (H, W, 3) display values; where: (H, W) bool."""
    return float(-10 * np.log10(((np.clip(got, 0, 1) - np.clip(want, 0, 1))[where] ** 2).mean() + 1e-12))


def measure(stage: Stage, shots: list[Shot], fitted: Gaussians | None) -> dict[str, np.ndarray]:
    """Way -> (shots, backgrounds, 2) dB: of the whole picture and of the person's pixels alone; of a headset the last eye's."""
    avatar, rows = stage.avatar, {way: [] for way in WAYS if fitted is not None or way != "refitted"}
    shown, eye = {"refitted": fitted}, stage.eyes - 1
    for shot in shots:
        rgb, alpha = trained_picture(stage.seen_by(shot, eye), avatar.faces, avatar.gaussians)
        for way, row in rows.items():
            stage.put(shot, shown.get(way) or avatar.gaussians)
            if way in ("own", "behind"):
                stage.draw_own(shot)
            found = []
            for background in BACKGROUNDS:
                got = (stage.lay(shot, background, way == "behind", eye=eye) if way in ("own", "behind")
                       else stage.draw_direct(shot, background, eye))
                want = rgb + (1 - alpha[..., None]) * background
                found.append([decibels(got, want, alpha >= 0), decibels(got, want, alpha > EDGE)])
            row.append(found)
    return {way: np.array(row) for way, row in rows.items()}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.unity.colours", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("avatars", nargs="+", type=Path, help=".gsac files")
    parser.add_argument("--stand-ins", type=Path, required=True,
                        help="folder of stand-ins for Unity's shader files: tests/unity/shims")
    parser.add_argument("--size", type=int, default=512, help="px, height and width of a picture")
    parser.add_argument("--shots", type=int, default=4)
    parser.add_argument("--no-refit", action="store_true", help="leave out the slow way")
    parser.add_argument("--headset", action="store_true", help="both eyes at once; judged is the right one")
    options = parser.parse_args()
    headset = [STEREO] if options.headset else []
    gpu, programs = Gpu(), compile_programs("", *headset, options.stand_ins)
    for path in options.avatars:
        avatar = RiggedAvatar.read(path)
        began = time.process_time()
        fitted = None if options.no_refit else refit(avatar)
        took = time.process_time() - began
        stage = Stage(gpu, programs, avatar, options.size, 1 + options.headset)
        found = measure(stage, make_shots(avatar, options.size, options.shots, 7), fitted)
        print(f"{path}: {len(avatar.gaussians)} gaussians; refitting took {took:.1f} CPU s")
        for way, db in found.items():
            print(f"  {way:9s} person {db[..., 1].mean():5.1f} dB (worst {db[..., 1].min():5.1f}), "
                  f"picture {db[..., 0].mean():5.1f} (worst {db[..., 0].min():5.1f}); person by background "
                  + " ".join(f"{b:g}: {x:.1f}" for b, x in zip(BACKGROUNDS, db[..., 1].mean(0), strict=True)), flush=True)


if __name__ == "__main__":
    main()
