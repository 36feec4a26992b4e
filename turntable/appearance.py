"""Colour of skin, eyes, clothes and hair as a function of the place on the template body (m) and the skin's regions.

Every painter takes paint (n, 3) and region (n, 6) and returns albedo (n, 3), linear RGB, and gloss (n,) in 0..1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gsac.turntable.noise import make_noise, sample_noise
from gsac.turntable.person import MATERIALS, Person, hair_field

SKIN_TONES = ((225, 178, 150), (205, 155, 125), (170, 118, 88), (120, 80, 58), (90, 58, 42))
HAIR_TONES = ((42, 30, 24), (70, 46, 30), (110, 76, 44), (28, 24, 24), (120, 60, 34))
IRISES = ((88, 60, 36), (78, 100, 116), (84, 104, 72), (60, 40, 28))
SHIRTS = ((168, 52, 48), (46, 96, 150), (60, 120, 88), (206, 170, 84), (120, 76, 140), (200, 200, 196))
TROUSERS = ((48, 62, 92), (92, 82, 70), (58, 58, 62), (112, 118, 108))
SHOES = ((60, 60, 64), (150, 46, 44), (208, 204, 196), (40, 60, 90))
FRAMES = ((24, 22, 22), (70, 40, 24), (110, 112, 118))
PATTERNS = ("stripes", "checks", "print", "raglan")
EYE_CENTRES = np.array([[0.0311, 0.8867, 0.1315], [-0.0311, 0.8867, 0.1315]], np.float32)
EYE_RADIUS = 0.0165


def to_linear(rgb: tuple[float, float, float]) -> np.ndarray:
    """8-bit sRGB to linear RGB (3,) in 0..1."""
    return ((np.asarray(rgb, np.float32) / 255) ** 2.2).astype(np.float32)


@dataclass
class Appearance:
    """One person's colours: (3,) linear RGB each."""

    person: Person
    noise: np.ndarray
    """(32, 32, 32, 3) of `make_noise`."""
    skin: np.ndarray  # (3,)
    hair: np.ndarray  # (3,)
    iris: np.ndarray  # (3,)
    shirt: tuple[np.ndarray, np.ndarray]
    """Colours (3,) of the ground and of the pattern."""
    trousers: np.ndarray  # (3,)
    shoes: np.ndarray  # (3,)
    pattern: str
    """One of `PATTERNS`."""
    worn: dict[str, np.ndarray]
    """Material of what else is worn -> colour (3,)."""
    bump: dict[str, tuple] = field(default_factory=lambda: {
        "shirt": (26.0, 0.16), "trousers": (22.0, 0.18), "hair": ((240.0, 30.0, 240.0), 0.25), "skin": (300.0, 0.02),
        "shoes": (60.0, 0.05), "eye": (1.0, 0.0), "skirt": (22.0, 0.14), "glasses": (1.0, 0.0), "hat": (180.0, 0.12),
        "phone": (1.0, 0.0)})
    """Material -> frequency (cells a metre) and strength of the noise on its normals."""

    def paint(self, material: np.ndarray, paint: np.ndarray, region: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """material: (n,) into MATERIALS; paint: (n, 3) m; region: (n, 6). Returns albedo (n, 3), gloss (n,) and bump (n, 3)."""
        albedo, gloss = np.zeros((len(paint), 3), np.float32), np.zeros(len(paint), np.float32)
        bump = np.zeros((len(paint), 3), np.float32)
        for i, name in enumerate(MATERIALS):
            here = np.flatnonzero(material == i)
            if len(here):
                place = paint[here]
                albedo[here], gloss[here] = getattr(self, f"_{name}")(place, region[here])
                frequency, strength = self.bump[name]
                if strength:
                    bump[here] = strength * sample_noise(self.noise, place, frequency)
        return albedo, gloss, bump

    def _skin(self, p, region):
        lips, ears, eyelids, nails, mouth, face = region.T
        x, y, z = p.T
        n = sample_noise(self.noise, p, 45)
        colour = self.skin * (1 + 0.05 * n[:, :1] + 0.03 * sample_noise(self.noise, p, 170)[:, :1])
        flush = np.maximum.reduce([_blob(np.abs(x) - 0.043, y - 0.845, z - 0.11, 0.024) * 0.6,
                                   _blob(x, y - 0.842, z - 0.163, 0.014) * 0.7, 0.6 * ears,
                                   0.3 * (np.abs(x) > 0.8)])[:, None]
        colour = colour * (1 + flush * np.array([0.06, -0.16, -0.14], np.float32))
        colour = _mix(colour, self.skin * np.array([0.80, 0.42, 0.42], np.float32), 0.8 * lips)
        colour = _mix(colour, self.skin * np.array([0.75, 0.62, 0.6], np.float32), 0.35 * eyelids)
        colour = _mix(colour, colour * 0.55 + 0.35 * to_linear((236, 200, 190)), 0.7 * nails)
        seam = np.clip(lips, 0, 1) * np.clip(mouth * 2, 0, 1)
        colour = _mix(colour, to_linear((60, 18, 18)), np.maximum(np.clip(mouth * 1.6 - 0.5 * lips, 0, 1), 0.6 * seam))
        for centre in EYE_CENTRES:
            d = np.linalg.norm(p - centre, axis=1)
            lash = np.clip((EYE_RADIUS * 1.13 - d) / 0.0015, 0, 1) * (z > centre[2])
            colour = _mix(colour, self.hair * 0.35, (0.85 - 0.35 * (y < centre[1] - 0.004)) * lash)
        colour = _mix(colour, self.hair * 0.8, self._brow(p))
        scalp = np.clip(hair_field(p, region) / 0.012 + 0.6, 0, 0.85) * (z < 0.14)
        return _mix(colour, self.hair, scalp), 0.28 + 0.25 * lips + 0.2 * nails

    def _brow(self, p):
        x, y, z = p.T
        side = np.abs(x)
        middle = 0.912 + 0.006 * np.sin((side - 0.012) / 0.042 * np.pi * 0.8) - 0.35 * np.clip(side - 0.046, 0, 1)
        thick = 0.0048 * np.clip((side - 0.008) / 0.006, 0, 1) * np.clip((0.062 - side) / 0.03, 0.15, 1)
        hairs = 0.8 + 0.4 * sample_noise(self.noise, p, (900, 200, 200))[:, 0]
        inside = np.clip((thick - np.abs(y - middle)) / 0.0022 + 0.3, 0, 1)
        return np.clip(inside * hairs * 0.9, 0, 1) * (side > 0.008) * (side < 0.062) * (z > 0.09)

    def _eye(self, p, region):
        centre = EYE_CENTRES[(p[:, 0] < 0).astype(int)]
        d = p - centre
        d /= np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-9)
        off = np.arccos(np.clip(d[:, 2], -1, 1))
        colour = np.broadcast_to(to_linear((228, 220, 214)), p.shape)
        ray = 1 + 0.35 * sample_noise(self.noise, d, 9)[:, :1]
        colour = _mix(colour, self.iris * ray, np.clip((0.47 - off) / 0.05, 0, 1))
        colour = _mix(colour, self.iris * 0.25, np.clip(1 - np.abs(off - 0.45) / 0.05, 0, 1) * 0.8)
        colour = _mix(colour, np.full(3, 0.004, np.float32), np.clip((0.20 - off) / 0.04, 0, 1))
        return colour, np.full(len(p), 1.0, np.float32)

    def _shirt(self, p, region):
        x, y, z = p.T
        ground, second = self.shirt
        sleeve = np.abs(x) > 0.21
        along = np.where(sleeve, np.abs(x), y)
        if self.pattern == "stripes":
            share = _soft((np.sin(along * 2 * np.pi / 0.062) - 0.25) * 4)
        elif self.pattern == "checks":
            across = np.where(sleeve, z + y, np.arctan2(x, z) * 0.14)
            share = 0.5 * sum(_soft(np.sin(u * 2 * np.pi / 0.07) * 5) for u in (along, across))
        elif self.pattern == "print":
            r = np.hypot(x, y - 0.47)
            ring = _soft((0.012 - np.abs(r - 0.075)) * 900) + _soft((0.034 - r) * 900)
            bars = _soft((0.010 - np.abs(np.abs(y - 0.47 + 0.6 * x) - 0.03)) * 900) * (r < 0.07) * (r > 0.04)
            back = _soft((0.025 - np.abs(y - 0.50)) * 900) * (np.abs(x) < 0.11)
            share = np.where(z > 0, np.clip(ring + bars, 0, 1), back)
        else:
            share = _soft((np.abs(x) - 0.17) * 900) * (y > 0.4)
        collar = 0.775 - self.person.outfit.neckline * np.clip(z - 0.01, -0.05, 0.2) - y
        trim = _soft((0.014 - collar) * 1500) * (np.abs(x) < 0.16)
        trim = np.maximum(trim, _soft((np.abs(x) - self.person.outfit.sleeve + 0.014) * 1500) * sleeve)
        colour = _mix(np.broadcast_to(ground, p.shape), second, np.clip(share, 0, 1))
        colour = _mix(colour, second * 0.7, np.clip(trim, 0, 1) * 0.8)
        hem = _soft((0.0016 - np.abs(y - self.person.outfit.hem - 0.02)) * 3000) * ~sleeve
        weave = 1 + 0.05 * sample_noise(self.noise, p, 420)[:, :1] + 0.06 * sample_noise(self.noise, p, 30)[:, 1:2]
        return colour * weave * (1 - 0.3 * hem[:, None]), np.full(len(p), 0.06, np.float32)

    def _trousers(self, p, region):
        x, y, z = p.T
        worn = sample_noise(self.noise, p, 16)[:, :1] * 0.10 + sample_noise(self.noise, p, 60)[:, :1] * 0.05
        twill = 0.06 * np.sin((x + y + z) * 2 * np.pi / 0.006)[:, None]
        fade = 0.25 * _blob(np.abs(x) - 0.16, (y + 0.12) * 0.4, z - 0.1, 0.08)[:, None]
        leg = 0.115 + 0.10 * np.clip((0.1 - y) / 0.85, 0, 1)
        seam = _soft((0.0022 - np.abs(z - 0.005)) * 2500) * (np.abs(x) > leg)
        pocket = _soft((0.0022 - np.abs((y - 0.10) - 0.9 * (np.abs(x) - 0.12))) * 2500) * (z > 0.03) * (y > 0.06)
        patch = np.maximum(np.abs(np.abs(x) - 0.085) / 0.055, np.abs(y - 0.035) / 0.06)
        patch = _soft((0.04 - np.abs(patch - 1)) * 60) * (z < 0)
        line = np.clip(seam + pocket + 0.7 * patch, 0, 1)[:, None]
        return self.trousers * (1 + worn + twill + fade) * (1 - 0.45 * line), np.full(len(p), 0.05, np.float32)

    def _shoes(self, p, region):
        x, y, z = p.T
        sole = _soft((0.019 - y) * 1200)
        lace = _soft(np.sin(y * 2 * np.pi / 0.012) * 5) * (np.abs(np.abs(x) - 0.21) < 0.02) * (z > 0.03) * (y > 0.06)
        colour = self.shoes * (1 + 0.08 * sample_noise(self.noise, p, 80)[:, :1])
        colour = _mix(colour, to_linear((225, 222, 214)), np.clip(sole + lace * 0.9, 0, 1))
        return colour, np.full(len(p), 0.2, np.float32)

    def _hair(self, p, region):
        around = np.arctan2(p[:, 0], p[:, 2] - 0.03)
        strand = np.stack([around * 0.09, p[:, 1] * 0.12 + p[:, 2] * 0.1, p[:, 2] * 0.1], -1)
        n = sample_noise(self.noise, strand, 420)[:, :1] * 0.3 + sample_noise(self.noise, strand, 1300)[:, :1] * 0.3
        return self.hair * (1 + n + 0.2 * sample_noise(self.noise, p, 40)[:, :1]), np.full(len(p), 0.16, np.float32)

    def _skirt(self, p, region):
        weave = 1 + 0.05 * sample_noise(self.noise, p, 300)[:, :1] + 0.08 * sample_noise(self.noise, p, 20)[:, 1:2]
        return self.worn["skirt"] * weave, np.full(len(p), 0.05, np.float32)

    def _glasses(self, p, region):
        return np.broadcast_to(self.worn["glasses"], p.shape), np.full(len(p), 0.7, np.float32)

    def _hat(self, p, region):
        knit = 1 + 0.10 * np.sin(p[:, 1:2] * 2 * np.pi / 0.007) + 0.08 * sample_noise(self.noise, p, 90)[:, :1]
        return self.worn["hat"] * knit, np.full(len(p), 0.04, np.float32)

    def _phone(self, p, region):
        screen = (np.abs(p[:, :2]).max(1) < 0.92) & (p[:, 2] > 0.5)
        return np.where(screen[:, None], to_linear((120, 150, 190)), to_linear((28, 28, 32))), np.full(len(p), 0.6, np.float32)


def make_appearance(person: Person, rng: np.random.Generator) -> Appearance:
    """Draws the colours of skin, hair, eyes and clothes."""
    def pick(table):
        return to_linear(table[rng.integers(len(table))]) * rng.uniform(0.9, 1.1, 3).astype(np.float32)

    noise = make_noise(rng)
    shirt = to_linear(SHIRTS[rng.integers(len(SHIRTS))])
    second = to_linear((232, 228, 218)) if shirt.mean() < 0.35 else to_linear((40, 48, 70))
    tone = int(rng.integers(len(SKIN_TONES)))
    hair = pick(HAIR_TONES[:4] if tone < 3 else HAIR_TONES[3:4])
    known = (pick(IRISES if tone < 3 else IRISES[3:]), (shirt, second), pick(TROUSERS), pick(SHOES), str(rng.choice(PATTERNS)))
    worn = {"skirt": pick(SHIRTS) * 0.7, "hat": pick(SHOES), "glasses": pick(FRAMES)}
    return Appearance(person, noise, to_linear(SKIN_TONES[tone]), hair, *known, worn)


def _mix(a, b, share):
    return a + (b - a) * np.asarray(share, np.float32)[:, None]


def _soft(x):
    return np.clip(x + 0.5, 0, 1)


def _blob(x, y, z, size):
    return np.exp(-(x * x + y * y + z * z) / (2 * size * size))
