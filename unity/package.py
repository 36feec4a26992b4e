"""Packs `unity/`, the Unity package: a folder and a tarball for the Package Manager, and with a person a `.unitypackage`.

The folder itself is a package too, which Unity takes from a git address (`?path=/unity`): its `.meta` files are committed.
`python -m gsac.unity.package` writes them. The same input gives the same bytes.
"""

from __future__ import annotations

import gzip
import io
import json
import tarfile
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from gsac.unity.meta import PACKAGE, file_meta, folder_meta, guid, person_guid, person_meta

HERE = Path(__file__).parent
SOURCES = (
    "CHANGELOG.md",
    "Documentation~/gsac-avatar.md",
    "Editor/Gsac.Editor.asmdef",
    "Editor/GsacAvatarEditor.cs",
    "Editor/GsacCastFiller.cs",
    "Editor/GsacHumanClip.cs",
    "Editor/GsacImporter.cs",
    "Editor/GsacPoseStreamEditor.cs",
    "Editor/GsacSceneBounds.cs",
    "Editor/GsacSceneViews.cs",
    "Editor/GsacSelfCheckMenu.cs",
    "Editor/GsacThumbnail.cs",
    "Editor/HighDefinition/Gsac.HighDefinition.Editor.asmdef",
    "Editor/HighDefinition/GsacRefractionInEditor.cs",
    "LICENSE.md",
    "README.md",
    "Runtime/Core/GsacCapsules.cs",
    "Runtime/Core/GsacContainer.cs",
    "Runtime/Core/GsacCorrectives.cs",
    "Runtime/Core/GsacData.cs",
    "Runtime/Core/GsacException.cs",
    "Runtime/Core/GsacExtent.cs",
    "Runtime/Core/GsacHarmonics.cs",
    "Runtime/Core/GsacHumanBones.cs",
    "Runtime/Core/GsacJson.cs",
    "Runtime/Core/GsacKept.cs",
    "Runtime/Core/GsacLivePose.cs",
    "Runtime/Core/GsacLoop.cs",
    "Runtime/Core/GsacMessageFault.cs",
    "Runtime/Core/GsacPacking.cs",
    "Runtime/Core/GsacParts.cs",
    "Runtime/Core/GsacPose.cs",
    "Runtime/Core/GsacPoseDraft.cs",
    "Runtime/Core/GsacPoseJson.cs",
    "Runtime/Core/GsacPoseMessage.cs",
    "Runtime/Core/GsacPoseOsc.cs",
    "Runtime/Core/GsacReader.cs",
    "Runtime/Core/GsacSort.cs",
    "Runtime/Core/GsacTimes.cs",
    "Runtime/Gsac.asmdef",
    "Runtime/GsacAddress.cs",
    "Runtime/GsacAsset.cs",
    "Runtime/GsacAvatar.cs",
    "Runtime/GsacBenchmark.cs",
    "Runtime/GsacCameras.cs",
    "Runtime/GsacCast.cs",
    "Runtime/GsacColliders.cs",
    "Runtime/GsacCrowd.cs",
    "Runtime/GsacDemo.cs",
    "Runtime/GsacDepths.cs",
    "Runtime/GsacEyes.cs",
    "Runtime/GsacFinish.cs",
    "Runtime/GsacHead.cs",
    "Runtime/GsacHit.cs",
    "Runtime/GsacHumanoid.cs",
    "Runtime/GsacLimb.cs",
    "Runtime/GsacLoader.cs",
    "Runtime/GsacMesh.cs",
    "Runtime/GsacModel.cs",
    "Runtime/GsacPicking.cs",
    "Runtime/GsacPicture.cs",
    "Runtime/GsacPoseStream.cs",
    "Runtime/GsacReach.cs",
    "Runtime/GsacRenderer.cs",
    "Runtime/GsacReport.cs",
    "Runtime/GsacSceneLight.cs",
    "Runtime/GsacShapes.cs",
    "Runtime/GsacSkeleton.cs",
    "Runtime/GsacSorted.cs",
    "Runtime/GsacSurface.cs",
    "Runtime/GsacView.cs",
    "Runtime/HighDefinition/Gsac.HighDefinition.asmdef",
    "Runtime/HighDefinition/GsacRefraction.cs",
    "Runtime/Resources/Gsac/Gsac.compute",
    "Runtime/Resources/Gsac/GsacBody.hlsl",
    "Runtime/Resources/Gsac/GsacBody.shader",
    "Runtime/Resources/Gsac/GsacBodyDepth.shader",
    "Runtime/Resources/Gsac/GsacCore.hlsl",
    "Runtime/Resources/Gsac/GsacDraw.hlsl",
    "Runtime/Resources/Gsac/GsacFinish.hlsl",
    "Runtime/Resources/Gsac/GsacFogBuiltIn.hlsl",
    "Runtime/Resources/Gsac/GsacFogHighDefinition.hlsl",
    "Runtime/Resources/Gsac/GsacJoin.compute",
    "Runtime/Resources/Gsac/GsacLatest.hlsl",
    "Runtime/Resources/Gsac/GsacOwn.hlsl",
    "Runtime/Resources/Gsac/GsacOwn.shader",
    "Runtime/Resources/Gsac/GsacPass.hlsl",
    "Runtime/Resources/Gsac/GsacSplats.shader",
    "Runtime/Resources/Gsac/GsacTrained.hlsl",
    "Runtime/Resources/Gsac/GsacTrained.shader",
    "Samples~/Crowd/Crowd.unity",
    "Samples~/Crowd/Gsac.Samples.Crowd.asmdef",
    "Samples~/Crowd/GsacCrowdOfTwenty.cs",
    "Samples~/Demo/Benchmark.unity",
    "Samples~/Demo/Demo.unity",
    "Samples~/FaceCapture/ARKit/Gsac.Samples.ARKit.asmdef",
    "Samples~/FaceCapture/ARKit/GsacARKitFace.cs",
    "Samples~/FaceCapture/FaceCapture.unity",
    "Samples~/FaceCapture/Gsac.Samples.FaceCapture.asmdef",
    "Samples~/FaceCapture/GsacFaceCapture.cs",
    "Samples~/FaceCapture/IGsacFace.cs",
    "Samples~/Mecanim/Gsac.Samples.Mecanim.asmdef",
    "Samples~/Mecanim/GsacMecanim.cs",
    "Samples~/Mecanim/Mecanim.unity",
    "Samples~/MixedReality/ARFoundation/Gsac.Samples.ARFoundation.asmdef",
    "Samples~/MixedReality/ARFoundation/GsacARRoom.cs",
    "Samples~/MixedReality/Gsac.Samples.MixedReality.asmdef",
    "Samples~/MixedReality/GsacControllers.cs",
    "Samples~/MixedReality/GsacFloorPlacement.cs",
    "Samples~/MixedReality/GsacMixedReality.cs",
    "Samples~/MixedReality/GsacPosePanel.cs",
    "Samples~/MixedReality/GsacRoomDepth.shader",
    "Samples~/MixedReality/GsacTouch.cs",
    "Samples~/MixedReality/IGsacHands.cs",
    "Samples~/MixedReality/IGsacRoom.cs",
    "Samples~/MixedReality/Meta/Gsac.Samples.Meta.asmdef",
    "Samples~/MixedReality/Meta/GsacMetaRoom.cs",
    "Samples~/MixedReality/MixedReality.unity",
    "Samples~/MixedReality/XRHands/Gsac.Samples.XRHands.asmdef",
    "Samples~/MixedReality/XRHands/GsacXRHands.cs",
    "Samples~/SelfCheckScene/SelfCheck.unity",
    "Samples~/Timeline/Gsac.Samples.Timeline.asmdef",
    "Samples~/Timeline/GsacFaceClip.cs",
    "Samples~/Timeline/GsacFaceTrack.cs",
    "Samples~/VR/VR.unity",
    "SelfCheck/Gsac.SelfCheck.asmdef",
    "SelfCheck/GsacCheckedView.cs",
    "SelfCheck/GsacPainter.cs",
    "SelfCheck/GsacSelfCheck.cs",
    "Tests/Editor/Gsac.Editor.Tests.asmdef",
    "Tests/Editor/GsacImportTests.cs",
    "Tests/Runtime/Gsac.Tests.asmdef",
    "Tests/Runtime/GsacPictureTests.cs",
    "Tests/Runtime/GsacReadingTests.cs",
    "package.json",
)
"""Files of the package. Whole names, so that the cache sees these files."""

PACKING = ("__init__.py", "meta.py", "package.py")
"""What lies in the folder and is not the package's: Unity wants a `.meta` of these too."""
SAMPLES = "Samples~"
"""Unity's name for a folder that the Package Manager copies into a project when the user asks for it."""
INSTALLED = "Assets/Gsac"
"""The folder of a project into which the .unitypackage is unpacked."""
PEOPLE = "People"
"""The folder in it that holds the people."""
LEFT_OUT = ("Documentation~/", "Tests/", "package.json")
"""What only the Package Manager can use; the samples but the demo as well."""


def write_unity(folder: Path, container: bytes, version: str) -> None:
    """Writes the three forms and the README into an empty folder; only the .unitypackage holds the person.

    container: the bytes of avatar.gsac; version: of the package, e.g. `0.1.0`.
    """
    files = {path: (HERE / path).read_bytes() for path in SOURCES}
    files["package.json"] = _manifest(files["package.json"], version)
    upm = files | _metas(files)
    for path, content in upm.items():
        place = folder / PACKAGE / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)
    (folder / f"{PACKAGE}-{version}.tgz").write_bytes(_tar({f"package/{path}": content for path, content in upm.items()}))
    (folder / "gsac-avatar.unitypackage").write_bytes(_tar(_unitypackage(files, container)))
    (folder / "README.md").write_bytes(files["README.md"])


def write_metas(folder: Path) -> None:
    """Writes the `.meta` files of the package's sources into a folder of them."""
    for path, content in _metas((*SOURCES, *PACKING)).items():
        (folder / path).write_bytes(content)


def _metas(paths: Iterable[str]) -> dict[str, bytes]:
    """Path of each `.meta` -> content; of what Unity hides (`Documentation~`) and of the folder of samples there is none."""
    seen = [path for path in paths if not path.startswith("Documentation~/")]
    metas = {f"{path}.meta": file_meta(_guid_path(path)).encode() for path in seen}
    return metas | {f"{path}.meta": folder_meta(_guid_path(path)).encode() for path in _folders(seen) if path != SAMPLES}


def _guid_path(path: str) -> str:
    """The path from which a GUID is made: a sample's files keep theirs where they are copied to."""
    return path.removeprefix(f"{SAMPLES}/")


def _folders(paths: Iterable[str]) -> list[str]:
    return sorted({str(parent) for path in paths for parent in PurePosixPath(path).parents} - {"."})


def _manifest(content: bytes, version: str) -> bytes:
    return json.dumps(json.loads(content) | {"version": version}, indent=2).encode() + b"\n"


def _unitypackage(files: dict[str, bytes], container: bytes) -> dict[str, bytes]:
    """Entries of Unity's own archive for each path: GUID/asset, GUID/asset.meta, GUID/pathname."""
    inside = {_guid_path(path): content for path, content in files.items()
              if not path.startswith(LEFT_OUT) and (not path.startswith(SAMPLES) or path.startswith(f"{SAMPLES}/Demo/"))}
    entries = {}
    for path in ["", PEOPLE, *_folders(inside)]:
        entries |= _entry(guid(path), path, folder_meta(path))
    for path, content in inside.items():
        entries |= _entry(guid(path), path, file_meta(path)) | {f"{guid(path)}/asset": content}
    person = person_guid(container)
    entries |= _entry(person, f"{PEOPLE}/avatar-{person[:8]}.gsac", person_meta(container)) | {f"{person}/asset": container}
    return entries


def _entry(name: str, path: str, meta: str) -> dict[str, bytes]:
    return {f"{name}/asset.meta": meta.encode(), f"{name}/pathname": f"{INSTALLED}/{path}".rstrip("/").encode()}


def _tar(files: dict[str, bytes]) -> bytes:
    """The bytes of a .tar.gz without times and owners."""
    raw = io.BytesIO()
    with tarfile.open(fileobj=raw, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for path, content in sorted(files.items()):
            entry = tarfile.TarInfo(path)
            entry.size, entry.mode = len(content), 0o644
            tar.addfile(entry, io.BytesIO(content))
    return gzip.compress(raw.getvalue(), 6, mtime=0)


if __name__ == "__main__":
    write_metas(HERE)
