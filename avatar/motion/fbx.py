"""Reads the motion of an FBX file, as Mixamo gives it, by ufbx. Every error names the file.

ufbx's binding can end its process on some files, so the file is read in one of its own: `python -m gsac.avatar.motion.fbx FILE`.
"""

from __future__ import annotations

import gc
import io
import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from gsac.avatar.motion.places import place_nodes
from gsac.avatar.motion.source import LARGEST, LONGEST_S, MAX_BYTES, RATE, MotionError, Source, most_frames, too_long

TIMEOUT_S = 60
MAX_MEMORY = 1 << 30
"""Of the process that reads the file, bytes."""


def read_fbx(path: Path) -> Source:
    """The longest motion of an FBX file. Rest: the nodes as the file has them without a motion. Raises MotionError."""
    size = Path(path).stat().st_size
    if size > MAX_BYTES:
        raise MotionError(f"{path}: it has {size} bytes, at most {MAX_BYTES} are read")
    try:
        done = subprocess.run([sys.executable, "-m", "gsac.avatar.motion.fbx", str(path)], capture_output=True, check=False,
                              timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        raise MotionError(f"{path}: reading it took longer than {TIMEOUT_S} s") from None
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise MotionError(f"{path}: {said[-1] if said and done.returncode == 2 else 'it cannot be read as FBX; is it whole?'}")
    with np.load(io.BytesIO(done.stdout)) as arrays:
        names, parents, rest, local = (arrays[name] for name in ("names", "parents", "rest", "local"))
    if not (np.abs(local) <= LARGEST).all() or not (np.abs(rest) <= LARGEST).all():
        raise MotionError(f"{path}: a place or turn that is not finite, or beyond {LARGEST:g}")
    rest_turns, rest_places = place_nodes(rest[None], parents)
    return Source(RATE, [str(name) for name in names], parents, rest_turns[0], rest_places[0], *place_nodes(local, parents))


def sample(path: str) -> dict[str, np.ndarray]:
    """names (P,), parents (P,), rest (P, 8) and local (T, P, 8) of an FBX file's bones and all above them."""
    import ufbx

    scene = ufbx.load_memory(Path(path).read_bytes())
    stacks = [(stack.time_end - stack.time_begin, stack.time_begin, stack.anim) for stack in scene.anim_stacks]
    if not stacks:
        raise ValueError("it holds no motion; expected an FBX file with an animation")
    length, begin, anim = max(stacks, key=lambda stack: stack[0])
    if not 0 <= length <= LONGEST_S:
        raise ValueError(f"a motion of {length:g} s; at most {LONGEST_S} are read")
    nodes, ids = [], {}

    def add(node: Any) -> int:
        """Index of a node, with all above it before it; the scene's own root is left out."""
        if node is None or node.is_root:
            return -1
        if node.typed_id not in ids:
            above = add(node.parent)
            ids[node.typed_id] = len(nodes)
            nodes.append((node, above))
        return ids[node.typed_id]

    every = list(scene.nodes)
    for node in [node for node in every if node.bone is not None] or every:
        add(node)
    if not nodes:
        raise ValueError("it holds no skeleton")
    times = begin + np.arange(int(length * RATE + 1e-6) + 1) / RATE
    if len(times) > most_frames(len(nodes)):
        raise ValueError(too_long(len(times), len(nodes)))
    local = np.empty((len(times), len(nodes), 8))
    for t, time in enumerate(times):
        local[t] = [row(ufbx.evaluate_transform(anim, node, float(time))) for node, _ in nodes]
    return {"names": np.array([node.name for node, _ in nodes]), "parents": np.array([above for _, above in nodes]),
            "rest": np.array([row(node.local_transform) for node, _ in nodes]), "local": local}


def row(transform: Any) -> list[float]:
    """Place, quaternion xyzw and mean scale of ufbx's transform."""
    place, turn, scale = transform.translation, transform.rotation, transform.scale
    return [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w, (scale.x + scale.y + scale.z) / 3]


def main() -> int:
    """Writes the arrays of the file to stdout and ends the process; what is wrong with it to stderr, with exit code 2."""
    gc.disable()  # ufbx's binding frees its scene in an order that ends the process
    resource.setrlimit(resource.RLIMIT_DATA, (MAX_MEMORY, MAX_MEMORY))
    out = io.BytesIO()
    try:
        arrays = sample(sys.argv[1])
        np.savez(out, names=arrays["names"], parents=arrays["parents"], rest=arrays["rest"], local=arrays["local"])
    except ValueError as e:
        print(e, file=sys.stderr)
        return 2
    except OSError as e:
        print(e.strerror, file=sys.stderr)
        return 2
    except MemoryError:
        print(f"reading it takes more than {MAX_MEMORY} bytes of memory", file=sys.stderr)
        return 2
    sys.stdout.buffer.write(out.getvalue())
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main())
