"""Every reader of what a user brings, with a whole file of its kind and what damages it; and attacks on them.

`python -m support.readers 100000` in tests/ gives so many damaged files to all readers, each reader in a process of its own with
1 GB of memory beside what it has after the whole file, and prints a table.
"""

import argparse
import contextlib
import functools
import io
import json
import os
import random
import resource
import select
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from support import mutate

MEMORY = 1 << 30
"""Bytes that a reader may take for a damaged file."""
SECONDS = 10
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Reader:
    """A reader of files with the suffix. whole: makes the bytes of a good file; read: reads one, as users' files are read."""

    suffix: str
    whole: Callable[[], bytes]
    read: Callable[[Path], object]
    damage: Callable[[bytes, random.Random], bytes] = mutate.bytes_of
    share: float = 1.0
    """Of the mutants that others get: a reader that starts programs is slow."""


@dataclass
class Tally:
    """What came of the attacks on one reader."""

    mutants: int = 0
    read: int = 0
    """Damaged files that were read as if they were good."""
    uncaught: list[str] = field(default_factory=list)
    """Mutant: error, of those that ended otherwise than in a sentence of ours."""
    large: list[int] = field(default_factory=list)
    """Mutants for which a reader took more than MEMORY."""
    slow: list[int] = field(default_factory=list)
    """Mutants that took more than SECONDS."""


def picture(form, **save):
    from PIL import Image

    out, rng = io.BytesIO(), np.random.default_rng(0)
    Image.fromarray(np.kron(rng.integers(0, 255, (6, 8, 3), np.uint8), np.ones((8, 8, 1), np.uint8))).save(out, form, **save)
    return out.getvalue()


def heif():
    import pillow_heif

    pillow_heif.register_heif_opener()
    return picture("HEIF")


def clip(suffix, *encode):
    from gsac.avatar.ffmpeg import ffmpeg_program

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        subprocess.run([ffmpeg_program(), "-loglevel", "error", "-f", "lavfi", "-i", "testsrc=size=64x48:rate=10:duration=0.5",
                        *encode, str(path)], check=True)
        return path.read_bytes()


def read_photo(path):
    from gsac.stages.split import photos

    photos.usual_size([path])
    photos.read_photo(path)


def probe(path):
    from gsac.stages.split import probe

    probe.probe(path)


def split(path):
    from gsac.stages.contract import Job
    from gsac.stages.split import STAGE
    from gsac.stages.split.config import SplitConfig
    from gsac.stages.split.stage import run

    with tempfile.TemporaryDirectory() as out:
        run(Job({"clip": path}, Path(out), SplitConfig()))
        for output in STAGE.outputs:
            output.check(Path(out) / output.path)


@functools.cache
def figure():
    from support.figure import make_figure

    return make_figure()


def npz(**arrays):
    out = io.BytesIO()
    np.savez_compressed(out, **arrays)
    return out.getvalue()


def amass():
    return npz(poses=np.full((3, 165), .1), trans=np.zeros((3, 3)), mocap_frame_rate=np.array(24.0), gender="neutral")


def bvh():
    from gsac.avatar.motion.source import Motion
    from support import dances

    rng = np.random.default_rng(0)
    motion = Motion(24.0, rng.normal(size=(3, 55, 3)).astype(np.float32) * .2, np.zeros((3, 3), np.float32))
    return dances.bvh_text(dances.Skeleton(figure().joint_names, figure().parents, figure().joints), motion).encode()


def glb():
    from gsac.stages.export.glb import glb_bytes
    from gsac.stages.export.stage import pose_gaussians
    from gsac.stages.export.texture import paint_surface

    rest = pose_gaussians(figure(), figure().pose("T"))
    return glb_bytes(figure(), paint_surface(figure(), *rest), *rest)


def gltf():
    """The document alone: its motion's numbers stand in it."""
    import base64

    data = glb()
    length = int.from_bytes(data[12:16], "little")
    document = json.loads(data[20:20 + length])
    kept = data[28 + length:]
    document = {name: document[name] for name in ("asset", "nodes", "skins", "animations", "accessors", "bufferViews", "buffers")}
    document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(kept).decode()
    return json.dumps(document).encode()


def fbx():
    from gsac.stages.export.fbx import avatar_fbx
    from gsac.stages.export.stage import pose_gaussians
    from gsac.stages.export.texture import paint_surface

    return avatar_fbx(figure(), paint_surface(figure(), *pose_gaussians(figure(), figure().pose("T"))))


def read_motion(path):
    from gsac.avatar.motion.files import read_motion

    read_motion(path, figure().joint_names, figure().parents, figure().joints)


def gsac():
    from gsac.avatar.gsac_file.write import avatar_bytes

    return avatar_bytes(figure())


def read_gsac(path):
    from gsac.avatar.gsac_file.rigged import RiggedAvatar

    RiggedAvatar.read(path)


def body():
    rng = np.random.default_rng(0)
    weights = np.zeros((60, 55), np.float32)
    weights[np.arange(60), np.arange(60) % 55] = 1
    return npz(v_template=rng.normal(size=(60, 3)), f=rng.integers(0, 60, (20, 3)), shapedirs=rng.normal(size=(60, 3, 20)),
               J_regressor=np.ones((55, 60)) / 60, weights=weights, kintree_table=np.array([[-1, *range(54)], range(55)]),
               lmk_faces_idx=np.arange(5), lmk_bary_coords=np.full((5, 3), 1 / 3), vt=np.zeros((9, 2)), ft=np.zeros((20, 3), int))


def read_body(path):
    from gsac.avatar.body_file import read_body_file

    read_body_file(path)


def flame():
    from gsac.avatar.flame_file import ARRAYS

    arrays = {name: np.zeros(shape, np.float16 if len(shape) == 3 else np.float32) for name, shape in ARRAYS.items()}
    arrays["weights"][:, 0] = 1
    arrays["kintree_table"] = np.array([[-1, 0, 1, 1, 1], range(5)])
    return npz(**arrays | {"f": arrays["f"].astype(int)})


def read_flame(path):
    from gsac.avatar.flame_file import read_flame

    read_flame(path)


def points():
    return npz(landmark_indices=np.arange(3), lmk_face_idx=np.arange(3), lmk_b_coords=np.full((3, 3), 1 / 3))


def read_points(path):
    from gsac.avatar.flame_file import read_flame_points

    read_flame_points(path)


def add_model(path):
    from gsac.pipeline.model_check import check_model

    check_model("mine", path)


def weights(suffix):
    arrays = {"lin0.weight": np.ones((1, 4, 1, 1), np.float32), "features.0.bias": np.arange(64, dtype=np.float32)}
    if suffix == ".npz":
        return npz(**arrays)
    if suffix == ".safetensors":
        head, at = {}, 0
        for name, array in arrays.items():
            head[name] = {"dtype": "F32", "shape": list(array.shape), "data_offsets": [at, at + array.nbytes]}
            at += array.nbytes
        text = json.dumps(head).encode()
        return len(text).to_bytes(8, "little") + text + b"".join(array.tobytes() for array in arrays.values())
    import torch

    out = io.BytesIO()
    torch.save({name: torch.from_numpy(array) for name, array in arrays.items()}, out)
    return out.getvalue()


def read_weights(path):
    from gsac.avatar.weight_file import read_weights

    read_weights(path)


def checkpoint():
    from gsac.stages.train.checkpoint import Checkpoints

    with tempfile.TemporaryDirectory() as folder:
        Checkpoints(Path(folder), print).write({"step": 3, "order": [1, 2], "trainer": {"a": np.arange(4.0)}})
        return (Path(folder) / "checkpoint.npz").read_bytes()


def read_checkpoint(path):
    from gsac.stages.train.checkpoint import Checkpoints

    there = path.with_name("checkpoint.npz")
    path.replace(there)
    Checkpoints(there.parent, lambda _: None).read()


def yaml():
    return ROOT.joinpath("params.yaml").read_bytes() + b"\na: &few {count: 10, fps: 0x1F}\nb: {<<: *few, c: *few}\n"


def read_yaml(path):
    from gsac.pipeline.graph import read_yaml

    read_yaml(path)


def read_dag(path):
    from gsac.pipeline.graph import Graph

    Graph.load(path)


READERS = {
    "photo jpeg": Reader(".jpg", lambda: picture("JPEG"), read_photo),
    "photo png": Reader(".png", lambda: picture("PNG"), read_photo),
    "photo webp": Reader(".webp", lambda: picture("WEBP"), read_photo),
    "photo bmp": Reader(".bmp", lambda: picture("BMP"), read_photo),
    "photo tiff": Reader(".tif", lambda: picture("TIFF", compression="tiff_lzw"), read_photo),
    "photo heic": Reader(".heic", heif, read_photo),
    "video mp4": Reader(".mp4", lambda: clip(".mp4"), probe),
    "video mov": Reader(".mov", lambda: clip(".mov", "-c:v", "png"), probe),
    "video webm": Reader(".webm", lambda: clip(".webm"), probe),
    "video avi": Reader(".avi", lambda: clip(".avi"), probe),
    "video ts": Reader(".ts", lambda: clip(".ts", "-c:v", "libx264"), probe),
    "video gif": Reader(".gif", lambda: clip(".gif"), probe),
    "split mp4": Reader(".mp4", lambda: clip(".mp4"), split, share=.05),
    "split mov": Reader(".mov", lambda: clip(".mov", "-c:v", "png"), split, share=.05),
    "motion npz": Reader(".npz", amass, read_motion, mutate.npz_of),
    "motion bvh": Reader(".bvh", bvh, read_motion, mutate.either),
    "motion glb": Reader(".glb", glb, read_motion),
    "motion gltf": Reader(".gltf", gltf, read_motion, mutate.either),
    "motion fbx": Reader(".fbx", fbx, read_motion, share=.03),
    "avatar gsac": Reader(".gsac", gsac, read_gsac),
    "body npz": Reader(".npz", body, read_body, mutate.npz_of),
    "flame npz": Reader(".npz", flame, read_flame, mutate.npz_of, share=.03),
    "points npz": Reader(".npz", points, read_points, mutate.npz_of),
    "models add": Reader(".npz", body, add_model, mutate.npz_of),
    "weights npz": Reader(".npz", lambda: weights(".npz"), read_weights, mutate.npz_of),
    "weights safetensors": Reader(".safetensors", lambda: weights(".safetensors"), read_weights, mutate.either),
    "weights pth": Reader(".pth", lambda: weights(".pth"), read_weights, share=.5),
    "checkpoint": Reader(".npz", checkpoint, read_checkpoint, mutate.npz_of),
    "params yaml": Reader(".yaml", yaml, read_yaml, mutate.either),
    "dag yaml": Reader(".yaml", lambda: ROOT.joinpath("dvc.yaml").read_bytes(), read_dag, mutate.either),
}


def attack(name: str, count: int, seed: int = 0, first: int = 0, begins: Callable[[int], None] = lambda _: None) -> Tally:
    """Gives the reader `name` damaged files, from number `first` to `count`. begins: called with each one's number."""
    from gsac.avatar.artifacts import ArtifactError
    from gsac.avatar.weight_file import WeightsError
    from gsac.stages.contract import BadInput

    reader, tally, whole = READERS[name], Tally(), READERS[name].whole()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, count):
            path = Path(folder) / f"damaged{reader.suffix}"
            path.write_bytes(reader.damage(whole, random.Random(f"{seed} {number}")))
            begins(number)
            tally.mutants += 1
            began = time.monotonic()
            try:
                reader.read(path)
                tally.read += 1
            except (ArtifactError, BadInput, WeightsError, MemoryError) as error:
                if _lacked_memory(error) and _peak(reader, path) > MEMORY:
                    tally.large.append(number)
            except Exception as error:  # what must not happen
                where = traceback.extract_tb(error.__traceback__)[-1]
                place = f"{Path(where.filename).name}:{where.lineno}"
                tally.uncaught.append(f"{number}: {type(error).__name__}: {str(error)[:200]} ({place})")
            if time.monotonic() - began > SECONDS:
                tally.slow.append(number)
    return tally


def _lacked_memory(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, MemoryError) or "allocate memory" in str(error):
            return True
        error = error.__cause__ or error.__context__
    return False


def _peak(reader: Reader, path: Path) -> int:
    """Bytes of memory that reading the file really takes: a size that is only asked for, and never filled, costs none."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (hard, hard))
    before = _kilobytes("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")
    with contextlib.suppress(Exception):
        reader.read(path)
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    return (_kilobytes("VmHWM") - before) * 1024


def _kilobytes(name: str) -> int:
    """A line of this process' memory in /proc."""
    return int(Path("/proc/self/status").read_text().split(f"{name}:")[1].split()[0])


def attack_apart(name: str, count: int, seed: int = 0) -> Tally:
    """As `attack`, in processes with bounded memory, which may die or hang."""
    whole, first = Tally(), 0
    while first < count:
        process = subprocess.Popen([sys.executable, "-m", "support.readers", "--one", name, str(count), str(seed), str(first)],
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=Path(__file__).parents[1],
                                   env=os.environ | {"PYTHONUNBUFFERED": "1"})
        at, end = first, None
        while True:
            ready, _, _ = select.select([process.stdout], [], [], 6 * SECONDS)  # so long for the start and the machine's other work
            line = process.stdout.readline() if ready else ""
            if not line:
                break
            if line.startswith("{"):
                end = json.loads(line)
                break
            at = int(line)
        process.kill()
        code = process.wait()
        if end is None:
            whole.mutants += at + 1 - first
            if ready:
                whole.uncaught.append(f"{at}: the process ended with {code}")
            else:
                whole.slow.append(at)
            first = at + 1
            continue
        for part, value in end.items():
            setattr(whole, part, getattr(whole, part) + value)
        break
    return whole


def _attack_one(name: str, count: int, seed: int, first: int) -> None:
    path = Path(tempfile.mkdtemp()) / f"whole{READERS[name].suffix}"
    path.write_bytes(READERS[name].whole())
    READERS[name].read(path)  # loads what it needs
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    bound = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (bound, resource.getrlimit(resource.RLIMIT_AS)[1]))
    print(json.dumps(vars(attack(name, count, seed, first, lambda number: print(number)))))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("count", type=int, nargs="?", help="mutants in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="readers whose name begins so")
    parser.add_argument("--one", nargs=4)
    arguments = parser.parse_args()
    if arguments.one:
        name, *numbers = arguments.one
        _attack_one(name, *map(int, numbers))
        return
    chosen = {name: reader for name, reader in READERS.items() if name.startswith(arguments.only)}
    each = arguments.count / sum(reader.share for reader in chosen.values())
    print("| reader | mutants | read | uncaught | above 1 GB | above 10 s |\n| --- | --- | --- | --- | --- | --- |")
    for name, reader in chosen.items():
        tally = attack_apart(name, max(1, round(each * reader.share)), arguments.seed)
        row = (name, tally.mutants, tally.read, len(tally.uncaught), len(tally.large), len(tally.slow))
        print(f"| {' | '.join(map(str, row))} |", flush=True)
        for line in [*tally.uncaught[:20], *(f"{number}: memory" for number in tally.large[:5]),
                     *(f"{number}: slow" for number in tally.slow[:5])]:
            print("   ", line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
