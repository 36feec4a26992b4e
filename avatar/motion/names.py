"""Matches the joints of other skeletons to SMPL-X's by name, through the spellings of common tools.

The viewer's scripts get `RULES` from here, so there is one table.
"""

from __future__ import annotations

import re

NOISE = ("mixamorig", "bip", "j", "c", "b", "f", "def", "org", "jnt", "bone", "bn")
"""Words without meaning in a name: prefixes of Mixamo, Biped, VRoid, Rigify."""
SIDES = {"left": "left_", "l": "left_", "right": "right_", "r": "right_"}
LIMBS = (
    ("hip", "upleg upperleg thigh thighbend hip"),
    ("knee", "lowerleg lowleg leg shin calf knee"),
    ("ankle", "ankle foot"),
    ("foot", "toebase toe toes ball foot"),
    ("shoulder", "upperarm uparm arm shldr shldrbend shoulder"),
    ("collar", "collar clavicle shoulder"),
    ("elbow", "forearm lowerarm lowarm forearmbend elbow"),
    ("wrist", "wrist hand"),
    ("eye_smplhf", "eye eyesmplhf"),
)
"""Joint without its side -> spellings; the first that is present and not yet taken counts. So `LeftShoulder` is the collar of a
skeleton with a `LeftArm`, and the upper arm of one without."""
MIDDLE = (("neck", "neck neck1"), ("head", "head"), ("jaw", "jaw"))
PHALANGES = {"index": "index", "middle": "middle mid", "pinky": "pinky little", "ring": "ring", "thumb": "thumb"}
PARTS = ("proximal", "intermediate", "distal")


def _rules() -> list[tuple[str, str, list[str]]]:
    rules = [(name, "", spellings.split()) for name, spellings in MIDDLE]
    for side in ("left_", "right_"):
        rules += [(side + name, side, spellings.split()) for name, spellings in LIMBS]
        for finger, words in PHALANGES.items():
            for k in (1, 2, 3):
                spellings = [s for w in words.split() for s in (f"{w}{k}", f"hand{w}{k}", w + PARTS[k - 1])]
                rules.append((f"{side}{finger}{k}", side, spellings))
        thumb = [r for r in rules if r[0].startswith(f"{side}thumb")]
        for (_, _, spellings), part in zip(thumb, ("metacarpal", "proximal", "distal"), strict=True):
            spellings.insert(0, f"thumb{part}")
    return rules


RULES = _rules()
"""(joint of SMPL-X, side, spellings) in the order of matching. VRM's thumb counts from its metacarpal."""


def split_side(name: str) -> tuple[str, str]:
    """Side (`left_`, `right_` or empty) and the bare word of a joint's name."""
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+", re.split(r"[:|]", name)[-1])
    side, out = "", []
    for i, word in enumerate(w.lower() for w in words):
        long = re.fullmatch(r"(left|right)([a-z]+)", word)
        if not side and (word in SIDES or long):
            side = SIDES[long[1] if long else word]
            out += [long[2]] if long else []
        elif word in NOISE or (word.isdigit() and i and words[i - 1].lower() == "bip"):
            continue
        else:
            out.append((word.lstrip("0") or "0") if word.isdigit() else word)
    return side, "".join(out)


def match(names: list[str]) -> dict[str, int]:
    """Joint of SMPL-X -> index into names, for the joints found. Hips and spine have no rule: `retarget` finds them by place."""
    known: dict[tuple[str, str], int] = {}
    for i, name in enumerate(names):
        known.setdefault(split_side(name), i)
    found: dict[str, int] = {}
    taken: set[int] = set()
    for joint, side, spellings in RULES:
        for word in spellings:
            at = known.get((side, word))
            if at is not None and at not in taken:
                found[joint] = at
                taken.add(at)
                break
    return found
