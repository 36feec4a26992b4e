"""avatar.usdz by the rules of its zip, and opened, checked and posed by Pixar's own library."""

import io
import struct
import zipfile

import numpy as np
import pytest

from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface
from gsac.stages.export.usdz import usdz_bytes


@pytest.fixture(scope="module")
def surface(figure):
    return paint_surface(figure, *pose_gaussians(figure, figure.pose("T")))


@pytest.fixture(scope="module")
def usdz(figure, surface):
    return usdz_bytes(figure, surface)


@pytest.fixture(scope="module")
def stage(usdz, tmp_path_factory):
    usd = pytest.importorskip("pxr.Usd", reason="needs the package usd-core (pip install usd-core)")
    path = tmp_path_factory.mktemp("usd") / "avatar.usdz"
    path.write_bytes(usdz)
    return usd.Stage.Open(str(path))


def test_the_scene_comes_first_and_each_file_is_stored_at_a_multiple_of_64_bytes(surface, usdz):
    with zipfile.ZipFile(io.BytesIO(usdz)) as archive:
        assert archive.namelist() == ["avatar.usda", "body.jpg"] and archive.testzip() is None
        assert archive.read("body.jpg") == surface.jpeg
        assert archive.read("avatar.usda").startswith(b"#usda 1.0\n")
        for info in archive.infolist():
            name, extra = struct.unpack_from("<HH", usdz, info.header_offset + 26)
            assert info.compress_type == zipfile.ZIP_STORED and (info.header_offset + 30 + name + extra) % 64 == 0


def test_same_input_same_bytes_and_an_avatar_without_clips_or_with_odd_words_is_a_file_too(figure, surface, usdz):
    from dataclasses import replace
    assert usdz_bytes(figure, surface) == usdz
    bare = usdz_bytes(replace(figure, clips={}, licence={"avatar": 'Ada\'s "own"\n{terms}'}), surface)
    with zipfile.ZipFile(io.BytesIO(bare)) as archive:
        text = archive.read("avatar.usda").decode()
    assert "endTimeCode = 0" in text and 'copyright = "Ada\'s \\"own\\"\\n{terms}"' in text


def test_pixar_s_checks_find_nothing_and_all_that_is_named_is_there(figure, stage):
    from pxr import UsdGeom, UsdShade, UsdValidation
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    assert [error.GetErrorAsString() for error in context.Validate(stage)] == []
    assert UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert stage.GetDefaultPrim().GetPath() == "/avatar"
    assert stage.GetRootLayer().customLayerData["copyright"] == "; ".join(figure.licence.values())
    body = stage.GetPrimAtPath("/avatar/body")
    material = UsdShade.MaterialBindingAPI(body).ComputeBoundMaterial()[0]
    picture = UsdShade.Shader(material.ComputeSurfaceSource()[0].GetInput("diffuseColor").GetConnectedSources()[0][0].source)
    assert picture.GetInput("file").Get().resolvedPath.endswith("avatar.usdz[body.jpg]")


def test_pixar_s_skinning_poses_it_as_the_avatar(figure, surface, stage):
    from pxr import Usd, UsdSkel
    root = UsdSkel.Root(stage.GetPrimAtPath("/avatar"))
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    skeleton = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/avatar/skeleton")))
    skin = cache.GetSkinningQuery(stage.GetPrimAtPath("/avatar/body"))
    assert [path.split("/")[-1] for path in skeleton.GetJointOrder()] == figure.joint_names
    name, clip = next(iter(figure.clips.items()))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, len(clip.rotation)), f"{name} closes its loop"
    assert stage.GetTimeCodesPerSecond() == clip.fps
    for key in (0, len(clip.rotation) // 3, len(clip.rotation)):
        points = stage.GetPrimAtPath("/avatar/body").GetAttribute("points").Get()
        assert skin.ComputeSkinnedPoints(skeleton.ComputeSkinningTransforms(key), points, key)
        pose = np.zeros((55, 3), np.float32)
        pose[[figure.joint_names.index(j) for j in clip.joints]] = clip.rotation[key % len(clip.rotation)]
        want = figure.posed(pose) + clip.transl[key % len(clip.rotation)] - (0, figure.ground, 0)
        np.testing.assert_allclose(np.array(points), want[surface.vertex], atol=5e-5)
