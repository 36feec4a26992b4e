"""The Unity package as export writes it: complete, the same every time, and every reference resolves."""

import io
import json
import re
import tarfile
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.gsac_file.container import unpack
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.cache.code import code_parts
from gsac.unity import package as unity_package

BUILT_IN = {"0000000000000000e000000000000000", "0000000000000000f000000000000000", "0" * 32}


@pytest.fixture(scope="module")
def upm(exported):
    """Path -> content of the package's folder."""
    root = exported / "unity" / "com.gsac.avatar"
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def unitypackage(exported):
    """Installed path -> (GUID, content or None for a folder, meta)."""
    with tarfile.open(exported / "unity" / "gsac-avatar.unitypackage") as tar:
        raw = {entry.name: tar.extractfile(entry).read() for entry in tar if entry.isfile()}
    guids = {name.split("/")[0] for name in raw}
    return {raw[f"{g}/pathname"].decode(): (g, raw.get(f"{g}/asset"), raw[f"{g}/asset.meta"].decode()) for g in guids}


def guid_of(meta):
    return re.search(r"^guid: ([0-9a-f]{32})$", meta, re.MULTILINE)[1]


def metas(upm):
    return {path.removesuffix(".meta"): content.decode() for path, content in upm.items() if path.endswith(".meta")}


def test_every_file_and_folder_has_a_meta_and_every_meta_its_file(upm):
    files = {path for path in upm if not path.endswith(".meta")}
    folders = {str(parent) for path in files for parent in Path(path).parents} - {".", "Samples~"}
    assert set(metas(upm)) == files | folders


def test_guids_are_unique_and_the_same_in_both_forms(upm, unitypackage):
    guids = {path.removeprefix("Samples~/"): guid_of(meta) for path, meta in metas(upm).items()}
    assert len(set(guids.values())) == len(guids)
    installed = {path.removeprefix("Assets/Gsac").lstrip("/"): guid for path, (guid, _, meta) in unitypackage.items()}
    assert all(guid == guid_of(meta) for guid, _, meta in unitypackage.values())
    assert len(installed) == len(set(installed.values()))
    assert {p: g for p, g in installed.items() if p} == {p: g for p, g in guids.items() if p != "package.json"}


def test_guids_do_not_change_with_the_person_or_the_version(upm, figure, tmp_path):
    unity_package.write_unity(tmp_path, avatar_bytes(figure), "9.9.9")
    root = tmp_path / "com.gsac.avatar"
    other = {str(path.relative_to(root)): guid_of(path.read_text()) for path in root.rglob("*.meta")}
    assert other == {f"{path}.meta": guid_of(meta) for path, meta in metas(upm).items()}
    assert json.loads((root / "package.json").read_text())["version"] == "9.9.9"


def test_the_tarball_is_the_folder(exported, upm):
    with tarfile.open(next((exported / "unity").glob("com.gsac.avatar-*.tgz"))) as tar:
        packed = {entry.name: tar.extractfile(entry).read() for entry in tar}
        assert {(entry.mtime, entry.uid, entry.uname) for entry in tar.getmembers()} == {(0, 0, "")}
    assert packed == {f"package/{path}": content for path, content in upm.items()}


def test_the_unitypackage_holds_what_the_folder_holds(upm, unitypackage):
    files = {path: content for path, (_, content, _) in unitypackage.items() if content is not None}
    installed = {path.removeprefix("Assets/Gsac/"): content for path, content in files.items()}
    assert installed == {path.removeprefix("Samples~/"): content for path, content in upm.items()
                         if not path.endswith(".meta") and path != "package.json"}


@pytest.mark.parametrize("scene", ["Demo", "Benchmark"])
def test_a_scenes_references_resolve_inside_the_package(upm, scene):
    text = upm[f"Samples~/Demo/{scene}.unity"].decode()
    known = {guid_of(meta): path for path, meta in metas(upm).items()}
    documents = {int(n): body for n, body in re.findall(r"^--- !u!\d+ &(\d+)\n(.*?)(?=^--- |\Z)", text, re.MULTILINE | re.DOTALL)}
    used = set()
    for file_id, guid in re.findall(r"\{fileID: (-?\d+)(?:, guid: ([^,}]+), type: 3)?\}", text):
        if guid:
            used.add((int(file_id), known[guid]))
        else:
            assert int(file_id) == 0 or int(file_id) in documents
    assert "{guid:" not in text
    script = {"Demo": "GsacDemo", "Benchmark": "GsacBenchmark"}[scene]
    scripts = {(11500000, f"Runtime/{name}.cs") for name in ("GsacAvatar", "GsacRenderer", script)}
    assert used == scripts | {(4900000, "Samples~/Demo/Avatar.bytes")}
    for path in (path for _, path in scripts):
        source = upm[path].decode()
        body = next(b for b in documents.values() if guid_of(metas(upm)[path]) in b)
        fields = body.split("m_EditorClassIdentifier: \n")[1]
        for field in re.findall(r"^  (\w+): ", fields, re.MULTILINE):
            declared = rf"SerializeField[^\n]*\n?[^\n]* {field}( = [^;\n]+)?;$"
            assert re.search(declared, source, re.MULTILINE), f"{path} has no serialized {field}"


def test_the_person_in_the_demo_is_the_exported_one(exported, upm):
    assert upm["Samples~/Demo/Avatar.bytes"] == (exported / "avatar.gsac").read_bytes()
    unpack(upm["Samples~/Demo/Avatar.bytes"])


def test_the_manifest_is_a_package_with_its_sample(upm):
    manifest = json.loads(upm["package.json"])
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"]) and manifest["name"] == "com.gsac.avatar"
    assert all(any(path.startswith(sample["path"] + "/") for path in upm) for sample in manifest["samples"])


def test_assemblies_are_named_apart_and_the_editor_is_kept_out_of_players(upm):
    runtime, editor = (json.loads(upm[path]) for path in ("Runtime/Gsac.asmdef", "Editor/Gsac.Editor.asmdef"))
    assert runtime["name"] == "Gsac" and editor["references"] == ["Gsac"] and editor["includePlatforms"] == ["Editor"]
    assert all(b"UnityEditor" not in content for path, content in upm.items() if path.startswith("Runtime/"))


def test_scripts_ask_for_resources_and_kernels_that_are_there(upm):
    source = "".join(content.decode() for path, content in upm.items() if path.startswith("Runtime/") and path.endswith(".cs"))
    for name in re.findall(r'Resources\.Load<\w+>\("([^"]+)"\)', source):
        assert any(path.startswith(f"Runtime/Resources/{name}.") and not path.endswith(".meta") for path in upm), name
    computes = "".join(content.decode() for path, content in upm.items() if path.endswith(".compute"))
    kernels = set(re.findall(r"#pragma kernel (\w+)", computes))
    assert set(re.findall(r'FindKernel\("(\w+)"\)', source)) <= kernels
    shaders = "".join(content.decode() for path, content in upm.items() if path.startswith("Runtime/Resources/"))
    for name in re.findall(r'PropertyToID\("(\w+)"\)', source):
        assert re.search(rf"\b{name}\b", shaders), f"no shader knows {name}"


def test_a_script_component_stands_in_a_file_of_its_name(upm):
    scripts = {path: content.decode() for path, content in upm.items() if path.endswith(".cs")}
    for path, source in scripts.items():
        for name in re.findall(r"class (\w+) : (?:MonoBehaviour|ScriptableObject)", source):
            assert Path(path).stem == name


def test_no_frame_reads_back_from_the_gpu(upm):
    for path, content in upm.items():
        if path.startswith("Runtime/") and path.endswith(".cs"):
            assert not re.search(rb"\.GetData\(|AsyncGPUReadback|BakeMesh|ReadPixels|GetVertexBuffer", content), path


def test_an_edit_of_any_file_of_the_package_counts_as_an_edit_of_the_stage(package):
    named = {name.partition("/")[2] for name in code_parts("gsac.stages.export.stage") if name.startswith("gsac.unity.package/")}
    assert named == {str(path.relative_to(package)) for path in package.rglob("*")
                     if path.is_file() and path.suffix not in (".py", ".pyc")}


def test_the_readme_names_methods_buttons_and_files_that_exist(upm, exported):
    readme = upm["README.md"].decode()
    source = "".join(content.decode() for path, content in upm.items() if path.endswith(".cs"))
    for call in re.findall(r"avatar\.(\w+)\(", readme) + ["Load"]:
        assert re.search(rf"public (?:static )?\w+ {call}\(", source), call
    for menu in ("Gsac Pose Stream", "Any Address", "Smoothing"):
        assert menu in readme and re.search(menu.replace(" ", " ?"), source, re.IGNORECASE), menu
    for name in ("gsac-avatar.unitypackage",):
        assert name in readme and (exported / "unity" / name).is_file()
    assert (exported / "unity" / "README.md").read_bytes() == upm["README.md"]
    avatar = RiggedAvatar.read(exported / "avatar.gsac")
    assert {"walk", "wave"} == set(avatar.clips) and np.isfinite(avatar.ground)
    assert io.BytesIO(upm["Samples~/Demo/Avatar.bytes"]).read(4) == b"GSAC"
