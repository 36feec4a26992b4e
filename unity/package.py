"""Packs `unity/`, the Unity package with an avatar in it: a folder and a tarball for the Package Manager, and a `.unitypackage`.

The same input gives the same bytes. Scenes refer to files of the package by `{guid:PATH}`, which is replaced by the GUID here.
"""

from __future__ import annotations

import gzip
import io
import json
import re
import tarfile
from pathlib import Path, PurePosixPath

from gsac.unity.meta import PACKAGE, file_meta, folder_meta, guid

HERE = Path(__file__).parent
SOURCES = (
    "README.md",
    "Demo/Benchmark.unity",
    "Demo/Demo.unity",
    "Editor/Gsac.Editor.asmdef",
    "Editor/GsacAvatarEditor.cs",
    "Editor/GsacHumanClip.cs",
    "Editor/GsacImporter.cs",
    "Editor/GsacPoseStreamEditor.cs",
    "Editor/GsacSceneViews.cs",
    "Runtime/Core/GsacContainer.cs",
    "Runtime/Core/GsacCorrectives.cs",
    "Runtime/Core/GsacData.cs",
    "Runtime/Core/GsacException.cs",
    "Runtime/Core/GsacExtent.cs",
    "Runtime/Core/GsacHumanBones.cs",
    "Runtime/Core/GsacJson.cs",
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
    "Runtime/GsacAsset.cs",
    "Runtime/GsacAvatar.cs",
    "Runtime/GsacBenchmark.cs",
    "Runtime/GsacCameras.cs",
    "Runtime/GsacCrowd.cs",
    "Runtime/GsacDemo.cs",
    "Runtime/GsacDepths.cs",
    "Runtime/GsacFinish.cs",
    "Runtime/GsacHumanoid.cs",
    "Runtime/GsacLimb.cs",
    "Runtime/GsacLoader.cs",
    "Runtime/GsacMesh.cs",
    "Runtime/GsacModel.cs",
    "Runtime/GsacPoseStream.cs",
    "Runtime/GsacReach.cs",
    "Runtime/GsacRenderer.cs",
    "Runtime/GsacShapes.cs",
    "Runtime/GsacSkeleton.cs",
    "Runtime/GsacSorted.cs",
    "Runtime/GsacView.cs",
    "Runtime/Resources/Gsac/Gsac.compute",
    "Runtime/Resources/Gsac/GsacCore.hlsl",
    "Runtime/Resources/Gsac/GsacDraw.hlsl",
    "Runtime/Resources/Gsac/GsacJoin.compute",
    "Runtime/Resources/Gsac/GsacPass.hlsl",
    "Runtime/Resources/Gsac/GsacSplats.shader",
)
"""Files of every package. Whole names, so that the cache sees these files."""

AVATAR = "Demo/Avatar.bytes"
SAMPLES = "Samples~"
"""Unity's name for a folder that the Package Manager copies into a project when the user asks for it."""
INSTALLED = "Assets/Gsac"
"""The folder of a project into which the .unitypackage is unpacked."""


def write_unity(folder: Path, container: bytes, version: str) -> None:
    """Writes the three forms and the README into an empty folder.

    container: the bytes of avatar.gsac; version: of the package, e.g. `0.1.0`.
    """
    files = collect_files(container)
    upm = {_in_upm(path): content for path, content in files.items()}
    upm["package.json"] = _manifest(version)
    upm |= {f"{path}.meta": file_meta(_guid_path(path)).encode() for path in list(upm)}
    upm |= {f"{path}.meta": folder_meta(_guid_path(path)).encode() for path in _folders(upm) if path != SAMPLES}
    for path, content in upm.items():
        place = folder / PACKAGE / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)
    (folder / f"{PACKAGE}-{version}.tgz").write_bytes(_tar({f"package/{path}": content for path, content in upm.items()}))
    (folder / "gsac-avatar.unitypackage").write_bytes(_tar(_unitypackage(files)))
    (folder / "README.md").write_bytes(files["README.md"])


def collect_files(container: bytes) -> dict[str, bytes]:
    """Path in the package -> content, with GUIDs filled in. container: the bytes of avatar.gsac."""
    files = {AVATAR: container}
    for path in SOURCES:
        content = (HERE / path).read_bytes()
        if path.endswith(".unity"):
            content = re.sub(r"\{guid:([^}]+)\}", lambda found: guid(found[1]), content.decode()).encode()
        files[path] = content
    return dict(sorted(files.items()))


def _in_upm(path: str) -> str:
    return f"{SAMPLES}/{path}" if path.startswith("Demo/") else path


def _guid_path(path: str) -> str:
    """The path from which a GUID is made: the demo's files keep theirs among the samples."""
    return path.removeprefix(f"{SAMPLES}/")


def _folders(paths: dict[str, bytes]) -> list[str]:
    return sorted({str(parent) for path in paths for parent in PurePosixPath(path).parents} - {"."})


def _manifest(version: str) -> bytes:
    return json.dumps({
        "name": PACKAGE, "version": version, "displayName": "GSAC Avatar", "unity": "2021.3",
        "description": "Animatable Gaussian avatars: import a .gsac file, animate it as a Humanoid, in any render pipeline.",
        "keywords": ["gaussian splatting", "avatar", "humanoid"],
        "dependencies": {"com.unity.modules.animation": "1.0.0", "com.unity.modules.imgui": "1.0.0"},
        "samples": [{"displayName": "Demo", "path": f"{SAMPLES}/Demo",
                     "description": "This person with buttons for poses, clips and expressions; and the benchmark scene."}],
    }, indent=2).encode() + b"\n"


def _unitypackage(files: dict[str, bytes]) -> dict[str, bytes]:
    """Entries of Unity's own archive for each path: GUID/asset, GUID/asset.meta, GUID/pathname."""
    entries = {}
    for path in ["", *_folders(files)]:
        entries[f"{guid(path)}/asset.meta"] = folder_meta(path).encode()
        entries[f"{guid(path)}/pathname"] = f"{INSTALLED}/{path}".rstrip("/").encode()
    for path, content in files.items():
        entries[f"{guid(path)}/asset"] = content
        entries[f"{guid(path)}/asset.meta"] = file_meta(path).encode()
        entries[f"{guid(path)}/pathname"] = f"{INSTALLED}/{path}".encode()
    return entries


def _tar(files: dict[str, bytes]) -> bytes:
    """The bytes of a .tar.gz without times and owners."""
    raw = io.BytesIO()
    with tarfile.open(fileobj=raw, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for path, content in sorted(files.items()):
            entry = tarfile.TarInfo(path)
            entry.size, entry.mode = len(content), 0o644
            tar.addfile(entry, io.BytesIO(content))
    return gzip.compress(raw.getvalue(), 6, mtime=0)
