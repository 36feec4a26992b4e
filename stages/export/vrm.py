"""`avatar.vrm`, VRM 1.0: the mesh of avatar.glb as a humanoid whose bones and expressions VRM's programs know by name.

The 52 actions are custom expressions by their ARKit names, which face trackers look for; VRM's own moods, vowels, blinks and
glances are made of them. The terms of use are the strictest that VRM has; what was agreed with the person stands beside them.
"""

from __future__ import annotations

from dataclasses import replace

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.stages.export.gltf_body import body_document
from gsac.stages.export.gltf_file import GltfFile
from gsac.stages.export.texture import Surface

VRM = "VRMC_vrm"
LICENCE = "https://vrm.dev/licenses/1.0/"
LIMBS = {"collar": "Shoulder", "shoulder": "UpperArm", "elbow": "LowerArm", "wrist": "Hand", "hip": "UpperLeg", "knee": "LowerLeg",
         "ankle": "Foot", "foot": "Toes", "eye_smplhf": "Eye"}
FINGERS = {"index": "Index", "middle": "Middle", "ring": "Ring", "pinky": "Little"}
PHALANGES, THUMB = ("Proximal", "Intermediate", "Distal"), ("Metacarpal", "Proximal", "Distal")
BONES = {"pelvis": "hips", "spine1": "spine", "spine2": "chest", "spine3": "upperChest", "neck": "neck", "head": "head",
         "jaw": "jaw"}
for _side in ("left", "right"):
    BONES |= {f"{_side}_{joint}": _side + bone for joint, bone in LIMBS.items()}
    BONES |= {f"{_side}_{finger}{k + 1}": f"{_side}{bone}{part}" for finger, bone in FINGERS.items()
              for k, part in enumerate(PHALANGES)}
    BONES |= {f"{_side}_thumb{k + 1}": f"{_side}Thumb{part}" for k, part in enumerate(THUMB)}
"""Joint of SMPL-X -> bone of VRM's humanoid."""
PRESETS = {
    "happy": "mouthSmileLeft .9 mouthSmileRight .9 cheekSquintLeft .6 cheekSquintRight .6 eyeSquintLeft .4 eyeSquintRight .4",
    "angry": "browDownLeft 1 browDownRight 1 eyeSquintLeft .4 eyeSquintRight .4 noseSneerLeft .4 noseSneerRight .4 "
             "mouthFrownLeft .4 mouthFrownRight .4 mouthPressLeft .4 mouthPressRight .4",
    "sad": "browInnerUp 1 mouthFrownLeft .7 mouthFrownRight .7 mouthShrugLower .4",
    "relaxed": "mouthSmileLeft .4 mouthSmileRight .4 eyeBlinkLeft .2 eyeBlinkRight .2",
    "surprised": "browInnerUp .8 browOuterUpLeft .8 browOuterUpRight .8 eyeWideLeft .8 eyeWideRight .8 jawOpen .35",
    "aa": "jawOpen .7",
    "ih": "jawOpen .2 mouthStretchLeft .5 mouthStretchRight .5",
    "ou": "jawOpen .15 mouthPucker .8",
    "ee": "jawOpen .2 mouthSmileLeft .3 mouthSmileRight .3 mouthStretchLeft .4 mouthStretchRight .4",
    "oh": "jawOpen .4 mouthFunnel .6",
    "blink": "eyeBlinkLeft 1 eyeBlinkRight 1",
    "blinkLeft": "eyeBlinkLeft 1",
    "blinkRight": "eyeBlinkRight 1",
    "lookUp": "eyeLookUpLeft 1 eyeLookUpRight 1",
    "lookDown": "eyeLookDownLeft 1 eyeLookDownRight 1",
    "lookLeft": "eyeLookOutLeft 1 eyeLookInRight 1",
    "lookRight": "eyeLookInLeft 1 eyeLookOutRight 1",
}
"""VRM's own expression -> actions and their weights."""
GLANCE_DEGREES = 30.0
"""Of a gaze at weight 1."""


def vrm_bytes(avatar: RiggedAvatar, surface: Surface) -> bytes:
    """The file's bytes; without the clips, for which VRM has files of their own. ArtifactError where a bone has no joint."""
    if missing := BONES.keys() - set(avatar.joint_names):
        raise ArtifactError(f"the avatar has no joint {', '.join(sorted(missing))}, which a VRM file needs")
    file = GltfFile()
    document = body_document(file, replace(avatar, clips={}), surface)
    mesh, joint = len(avatar.joints), avatar.joint_names.index
    left, right, head = (avatar.joints[joint(name)] for name in ("left_eye_smplhf", "right_eye_smplhf", "head"))
    range_map = {"inputMaxValue": GLANCE_DEGREES, "outputScale": 1.0}
    document["extensionsUsed"] = [VRM]
    document["extensions"] = {VRM: {
        "specVersion": "1.0", "meta": state_terms(avatar.licence),
        "humanoid": {"humanBones": {bone: {"node": joint(name)} for name, bone in BONES.items()}},
        "expressions": name_expressions(avatar.expression_names, mesh),
        "firstPerson": {"meshAnnotations": [{"node": mesh, "type": "auto"}]},
        "lookAt": {"type": "expression", "offsetFromHeadBone": ((left + right) / 2 - head).tolist()} | {
            f"rangeMap{way}": range_map for way in ("HorizontalInner", "HorizontalOuter", "VerticalDown", "VerticalUp")},
    }}
    return file.glb(document)


def state_terms(licence: dict[str, str]) -> dict:
    """VRM's terms of use. licence: of the avatar and of the body's mesh, in words."""
    return {
        "name": "avatar", "version": "1", "authors": ["the person shown"], "licenseUrl": LICENCE,
        "copyrightInformation": licence.get("avatar", ""), "thirdPartyLicenses": licence.get("body", ""),
        "avatarPermission": "onlySeparatelyLicensedPerson", "allowExcessivelyViolentUsage": False,
        "allowExcessivelySexualUsage": False, "commercialUsage": "personalNonProfit", "allowPoliticalOrReligiousUsage": False,
        "allowAntisocialOrHateUsage": False, "creditNotation": "required", "allowRedistribution": False,
        "modification": "prohibited",
    }


def name_expressions(names: list[str], mesh: int) -> dict:
    """VRM's own expressions, as far as the actions have what they are made of, and the actions. mesh: node of the morph targets."""
    def bind(weights: dict[str, float]) -> dict:
        return {"morphTargetBinds": [{"node": mesh, "index": names.index(n), "weight": w} for n, w in weights.items()]}

    preset = {}
    for name, words in PRESETS.items():
        parts = words.split()
        weights = dict(zip(parts[::2], map(float, parts[1::2]), strict=True))
        if weights.keys() <= set(names):
            preset[name] = bind(weights)
    return {"preset": preset, "custom": {name: bind({name: 1.0}) for name in names}}
