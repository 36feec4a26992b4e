"""The person of a clip: a body outside the span of the fit's shape basis, in clothes and hair that the body model lacks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gsac.avatar.body import Body
from gsac.avatar.skinning import skin
from gsac.turntable.options import TurntableOptions
from gsac.turntable.shell import Piece, Shell, cut_mesh, drape, pull_to_hull, raise_surface
from gsac.turntable.wear import brim, glasses, hood, long_hair, phone, skirt

REGIONS = Path(__file__).with_name("regions.npz")
"""`share` (6, V) uint8 at each vertex, in 255ths: lips, ears, eyelids, nails, inner mouth, face;
from MakeHuman's CC0 texture masks, baked by `tools/open_body/bake_regions.py`."""
OUTSIDE = Path(__file__).with_name("outside.npz")
"""Effect of single local shape sliders: `vertices` (S, V, 3) and `joints` (S, 55, 3), m; baked by `tools/open_body/bake.py`."""
EYES = slice(13574, 13718)
"""Vertices of both eyeballs in the open body."""
MATERIALS = ("skin", "eye", "shirt", "trousers", "shoes", "hair", "skirt", "glasses", "hat", "phone")


@dataclass
class Outfit:
    """Cut of clothes and hair, which decides both shape and colour."""

    sleeve: float
    """m from the mid plane to the end of the sleeve, in the T-pose."""
    hem: float
    """m, height of the shirt's hem on the template."""
    cuff: float
    """m, height of the trousers' end on the template."""
    hair: str
    """`short` or `bob`."""
    neckline: float
    """Slope of the neckline, m of height a metre of depth."""
    wide: float = 0.0
    """m by which the shirt is wider than one that fits: a hoodie."""
    hat: bool = False
    """Whether a hat covers the top of the head."""


@dataclass
class Person:
    """A mesh of N drawn vertices, each on the line between two of C skinned control vertices."""

    body: Body
    outfit: Outfit
    betas: np.ndarray  # (B,)
    rest: np.ndarray
    """(C, 3) m, T-pose; the first V are the bare body."""
    joints: np.ndarray
    """(55, 3) m, T-pose."""
    joint_offset: np.ndarray
    """(55, 3) m from the joints that the betas give."""
    skin_index: np.ndarray
    """(C, 4) joints of the skinning weights."""
    skin_weight: np.ndarray
    """(C, 4)."""
    pair: np.ndarray
    """(N, 2) control vertices."""
    share: np.ndarray
    """(N,) weight of the second of the pair."""
    faces: np.ndarray
    """(F, 3) into N: visible skin, clothes, hair."""
    material: np.ndarray
    """(F,) uint8 into MATERIALS."""
    paint: np.ndarray
    """(N, 3) m, texture coordinates: place on the template body, equal for all people; y of shoes: height above the sole."""
    region: np.ndarray
    """(N, 6) in 0..1, see `REGIONS`."""

    def pose(self, transforms: np.ndarray, expression: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """transforms: (55, 3, 4) of the joints; expression: (52,). Returns bare body (V, 3) and drawn mesh (N, 3), m."""
        count = len(self.body.v_template)
        rest = self.rest.copy()
        if expression.any():
            rest[:count] += self.body.exprdirs @ expression.astype(np.float32)
        control = skin(rest, transforms.astype(np.float32), self.skin_index, self.skin_weight)
        first, second = control[self.pair[:, 0]], control[self.pair[:, 1]]
        return control[:count], first + (second - first) * self.share[:, None]

    @property
    def height_m(self) -> float:
        """Height of the bare body in the T-pose, m."""
        y = self.rest[: len(self.body.v_template), 1]
        return float(y.max() - y.min())


def make_person(options: TurntableOptions, rng: np.random.Generator) -> Person:
    """Draws a body and its outfit."""
    body = Body.load()
    spread = np.linspace(0.8, 0.32, body.num_figure)
    betas = (rng.normal(0, 1, body.num_figure) * spread).clip(-1.6, 1.6).astype(np.float32)
    shift, joint_offset = leave_basis(body, options.outside, rng)
    rest, joints = body.rest(betas, None, joint_offset)
    rest = rest + shift
    outfit = Outfit(sleeve=float(rng.choice([0.36, 0.42, 0.66])), hem=float(rng.uniform(0.07, 0.12)),
                    cuff=float(rng.choice([-0.755, -0.755, -0.755, -0.24])), hair=str(rng.choice(["short", "bob"])),
                    neckline=float(rng.uniform(0.5, 0.9)))
    region = np.load(REGIONS)["share"].T.astype(np.float32) / 255
    outfit = choose(outfit, options)
    shells, hidden = dress(body, rest, region, outfit, options.clothing, rng)
    pieces = accessories(body, rest, joints, shells, outfit, options)
    return assemble(body, outfit, betas, rest, joints, joint_offset, region, shells, hidden, pieces)


def choose(outfit: Outfit, options: TurntableOptions) -> Outfit:
    """The outfit as the options want it; what they leave open is as drawn."""
    changes: dict[str, Any] = {"hat": options.hat != "none"}
    if options.top == "hoodie":
        changes |= {"sleeve": 0.72, "hem": 0.08, "neckline": 0.45, "wide": 0.034}
    if options.legs == "skirt":
        changes |= {"cuff": -0.08}
    if options.hair == "long":
        changes |= {"hair": "bob"}
    return replace(outfit, **changes)


def accessories(body: Body, rest: np.ndarray, joints: np.ndarray, shells: list[Shell], outfit: Outfit,
                options: TurntableOptions) -> list[Piece]:
    """What the options want beside shells. rest: (V, 3) m; joints: (55, 3) m."""
    template = body.v_template
    worn = {shell.material: shell for shell in shells}
    surface = {name: shell.rest[np.unique(shell.pair)] for name, shell in worn.items()}
    out = []
    if options.legs == "skirt":
        used = np.unique(worn["shirt"].pair)
        used = used[np.abs(template[used, 0]) < 0.2]
        tucked = worn["shirt"].rest[used] if not outfit.wide else rest[used]
        out.append(skirt(np.concatenate([rest[np.abs(template[:, 0]) < 0.3], tucked]), joints, outfit.hem, options.clothing))
    if options.top == "hoodie":
        out.append(hood(rest[:EYES.start], body.faces[(body.faces < EYES.start).all(1)], joints, options.clothing))
    if options.hair == "long":
        around = np.concatenate([rest, surface["shirt"], *(piece.rest for piece in out)])
        out.append(long_hair(surface["hair"], around, joints, options.clothing))
    if options.glasses:
        out += glasses(rest, joints)
    if options.hat == "cap":
        out.append(brim(worn["hat"], template, joints))
    if options.behaviour.endswith("phone"):
        out.append(phone(joints, options.behaviour.split("_")[0]))
    return out


def leave_basis(body: Body, amount: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (V, 3) m and joint offset (55, 3) m outside the shape basis: five local sliders, and a wave over the skin."""
    with np.load(OUTSIDE) as z:
        fields, joints = z["vertices"].astype(np.float32), z["joints"]
    pick = rng.choice(len(fields), 5, replace=False)
    share = rng.uniform(-0.5, 0.5, 5).astype(np.float32) * amount
    shift = np.tensordot(share, fields[pick], 1)
    wave = sum(np.sin(body.v_template @ rng.normal(0, 9, 3) + rng.uniform(0, 6.28))[:, None] * rng.normal(0, 1, 3)
               for _ in range(5))
    calm = np.clip(1 - 4 * np.abs(np.abs(body.v_template[:, :1]) - 0.85), 0, 1) + (body.v_template[:, 1:2] > 0.76)
    shift = shift + 0.0025 * amount * wave * (1 - np.clip(calm, 0, 1))  # not on hands and head
    return shift.astype(np.float32), np.tensordot(share, joints[pick], 1).astype(np.float32)


def dress(body: Body, rest: np.ndarray, region: np.ndarray, outfit: Outfit, thick: float, rng: np.random.Generator,
          ) -> tuple[list[Shell], np.ndarray]:
    """Makes clothes and hair over a body.

    rest: (V, 3) m; region: (V, 6); thick: factor on thickness. Returns the shells and the vertices (V,) bool that they cover fully.
    """
    template, faces = body.v_template, body.faces
    x, y, z = template.T
    arm = np.abs(x)
    skin_only = np.ones(len(template), bool)
    skin_only[13348:] = False  # tongue and eyeballs
    fold = make_folds(template, rng)
    neck = 0.775 - outfit.neckline * np.clip(z - 0.01, -0.05, 0.2)
    near_neck = np.clip((0.16 - arm) / 0.04, 0, 1)
    fields = {
        "shirt": np.minimum.reduce([y - outfit.hem, (outfit.sleeve - arm) * 1.0, np.where(near_neck > 0, neck - y, 0.2)]),
        "trousers": np.minimum.reduce([outfit.hem + 0.07 - y, y - outfit.cuff, 0.4 - arm]),
        "shoes": np.minimum(-0.715 - y, 0.6 - arm),
        "hair": hair_field(template, region),
    }
    waist = np.clip((0.36 - y) / 0.25, 0, 1) * (arm < 0.3)
    sleeve = np.clip((arm - 0.25) / (outfit.sleeve - 0.2), 0, 1.2) * (y > 0.45)
    leg = np.clip((0.0 - y) / 0.7, 0, 1)
    thickness = {
        "shirt": 0.008 + 0.010 * waist + 0.014 * sleeve * (outfit.sleeve < 0.5) + 0.006 * sleeve + fold * 0.006,
        "trousers": np.where(y > outfit.hem - 0.03, 0.004, 0.008 + 0.020 * leg + fold * 0.008 * (0.4 + leg)),
        "shoes": np.full(len(template), 0.010),
        "hair": hair_thickness(template, fields["hair"], outfit, rng),
    }
    if outfit.wide:
        thickness["shirt"] = thickness["shirt"] + outfit.wide * (0.35 + 0.65 * np.clip((0.62 - y) / 0.1, 0, 1)
                                                                 ) * (1 + 0.3 * fold) * np.clip((0.74 - arm) / 0.06, 0.2, 1)
    if outfit.hat:
        fields["hat"] = hat_field(template, region)
        thickness["hat"] = thickness["hair"] + 0.009
    shells = []
    hidden = np.zeros(len(template), bool)
    for name, field in fields.items():
        field = np.where(skin_only, field, -1.0)
        member = field > -0.06
        lift = raise_surface(rest, faces, member, np.maximum(thickness[name], 0.003) * thick,
                             {"shirt": 16, "trousers": 12, "shoes": 6, "hair": 6, "hat": 6}[name])
        if name == "shirt":
            lift = drape(lift, np.clip((0.52 - y) / 0.08, 0, 1) * (arm < 0.3) * member)
        paint = template
        if name == "shoes":
            for sign in (1, -1):
                lift = pull_to_hull(lift, np.clip((z - 0.07) / 0.06, 0, 1) * (field > 0) * (sign * x > 0))
            sole = rest[skin_only, 1].min() - 0.018
            low = np.clip((-0.806 - y) / 0.014, 0, 1)
            lift[:, 1] += low * (sole - lift[:, 1]) * 0.9
            paint = np.stack([x, lift[:, 1] - sole, z], 1)
        if name == "hair" and outfit.hair == "bob":
            lift = lengthen_hair(lift, template, field, thick)
        pair, share, cut_faces = cut_mesh(faces, field)
        shells.append(Shell(name, lift.astype(np.float32), pair, share, cut_faces, paint.astype(np.float32)))
        hidden |= field > {"shirt": 0.03, "trousers": 0.02, "shoes": 0.02, "hair": 0.03, "hat": 0.03}[name]
    return shells, hidden


def hair_field(template: np.ndarray, region: np.ndarray) -> np.ndarray:
    """(N,) m, positive on the scalp; the hairline runs from the forehead over the ears to the nape.

    template: (N, 3) m, place on the template body; region: (N, 6).
    """
    x, y, z = template.T
    around = np.arctan2(np.abs(x), z - 0.045)  # 0 in front, pi behind
    line = np.interp(around, [0, 0.55, 0.9, 1.25, 1.75, 2.3, np.pi],
                     [0.967, 0.962, 0.940, 0.885, 0.860, 0.812, 0.800])
    return np.where((y > 0.77) & (np.abs(x) < 0.13), np.minimum(y - line, 0.03 - 0.08 * region[:, 1]), -1.0)


def hat_field(template: np.ndarray, region: np.ndarray) -> np.ndarray:
    """(N,) m, positive under a hat: from the forehead over the ears to the nape. template: (N, 3) m; region: (N, 6)."""
    x, y, z = template.T
    line = np.interp(np.arctan2(np.abs(x), z - 0.045), [0, 0.9, 1.5, np.pi], [0.945, 0.935, 0.905, 0.870])
    return np.where((y > 0.77) & (np.abs(x) < 0.13), np.minimum(y - line, 0.04 - 0.10 * region[:, 1]), -1.0)


def hair_thickness(template: np.ndarray, field: np.ndarray, outfit: Outfit, rng: np.random.Generator) -> np.ndarray:
    """(V,) m. template: (V, 3) m; field: (V,) of `hair_field`."""
    x, y, z = template.T
    rise = 0.15 + 0.85 * np.clip(field / 0.04, 0, 1) if outfit.hair == "short" else 0.3 + 0.7 * np.clip(field / 0.04, 0, 1)
    up = np.clip((y - 0.86) / 0.12, 0, 1)
    behind = np.clip((0.08 - z) / 0.1, 0, 1)
    tuft = sum(np.sin(template @ rng.normal(0, 60, 3) + rng.uniform(0, 6.28)) for _ in range(4)) / 4
    base = 0.006 + 0.020 * up if outfit.hair == "short" else 0.014 + 0.014 * up + 0.008 * behind
    return (base + 0.006 * tuft * up) * rise


def lengthen_hair(lift: np.ndarray, template: np.ndarray, field: np.ndarray, thick: float) -> np.ndarray:
    """Pulls the lower rows of long hair down to the shoulders, behind the ears.

    lift: (V, 3) m, surface of the hair; template: (V, 3) m; field: (V,) of `hair_field`; thick: factor. Returns lift (V, 3) m.
    """
    x, y, z = template.T
    around = np.arctan2(np.abs(x), z - 0.045)
    side = np.clip((around - 1.75) / 0.3, 0, 1)
    low = np.clip(1 - field / 0.05, 0, 1) ** 1.5 * side * (field > -0.02) * (y > 0.78)
    out = lift.copy()
    out[:, 1] -= 0.095 * low * thick
    radial = np.stack([x, np.zeros_like(x), z - 0.03], -1)
    radial /= np.maximum(np.linalg.norm(radial, axis=1, keepdims=True), 1e-9)
    return out + radial * (0.018 * low * thick)[:, None]


def make_folds(template: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Folds of cloth, mostly across the limbs: (V,) about -1..1. template: (V, 3) m."""
    waves = [np.sin(template @ (rng.normal(0, 1, 3) * [14, 34, 16]) + rng.uniform(0, 6.28)) for _ in range(6)]
    return np.sum(waves, 0) / 3


def assemble(body: Body, outfit: Outfit, betas: np.ndarray, rest: np.ndarray, joints: np.ndarray, joint_offset: np.ndarray,
             region: np.ndarray, shells: list[Shell], hidden: np.ndarray, pieces: list[Piece]) -> Person:
    """Joins body, shells and pieces into one control mesh and one drawn mesh.

    betas: (B,); rest: (V, 3) m; joints, joint_offset: (55, 3) m; region: (V, 6); hidden: (V,) bool, skin that is left out.
    """
    count = len(rest)
    own = np.arange(count)
    bare = body.faces[~hidden[body.faces].all(1)]
    control, pairs, shares, faces = [rest], [np.stack([own, own], 1)], [np.zeros(count)], [bare]
    eye = (bare >= EYES.start).all(1)
    materials = [np.where(eye, MATERIALS.index("eye"), MATERIALS.index("skin"))]
    source, paints = [own], [body.v_template]
    at_control, at_drawn = count, count
    for shell in shells:
        used, pair = np.unique(shell.pair, return_inverse=True)
        control.append(shell.rest[used])
        source.append(used)
        paints.append(shell.paint[used])
        pairs.append(pair.reshape(-1, 2) + at_control)
        shares.append(shell.share)
        faces.append(shell.faces + at_drawn)
        materials.append(np.full(len(shell.faces), MATERIALS.index(shell.material)))
        at_control += len(used)
        at_drawn += len(shell.share)
    index, weight = body.skin_index[np.concatenate(source)], body.skin_weight[np.concatenate(source)]
    regions = region[np.concatenate(source)]
    for piece in pieces:
        own = np.arange(len(piece.rest)) + at_control
        control.append(piece.rest)
        paints.append(piece.paint)
        index, weight = np.concatenate([index, piece.skin_index]), np.concatenate([weight, piece.skin_weight])
        regions = np.concatenate([regions, np.zeros((len(own), regions.shape[1]), regions.dtype)])
        pairs.append(np.stack([own, own], 1))
        shares.append(np.zeros(len(own)))
        faces.append(piece.faces + at_drawn)
        materials.append(np.full(len(piece.faces), MATERIALS.index(piece.material)))
        at_control += len(own)
        at_drawn += len(own)
    pair, share = np.concatenate(pairs), np.concatenate(shares).astype(np.float32)

    def interpolate(values: np.ndarray) -> np.ndarray:
        a, b = values[pair[:, 0]], values[pair[:, 1]]
        return (a + (b - a) * share[:, None]).astype(np.float32)

    return Person(body, outfit, betas, np.concatenate(control).astype(np.float32), joints, joint_offset,
                  index, weight, pair, share, np.concatenate(faces),
                  np.concatenate(materials).astype(np.uint8), interpolate(np.concatenate(paints)), interpolate(regions))
