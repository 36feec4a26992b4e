"""The Unity package as export writes it: complete, the same every time, and every reference resolves."""

import json
import re
import tarfile
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.cache.code import code_parts
from gsac.unity import package as unity_package
from gsac.unity.meta import person_guid

BUILT_IN = {"0000000000000000e000000000000000", "0000000000000000f000000000000000", "0" * 32}


@pytest.fixture(scope="module")
def upm(exported):
    """Path -> content of the package's folder."""
    root = exported / "unity" / "com.gsac.avatar"
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def unitypackage(exported):
    """Installed path -> (GUID, content or None for a folder, meta)."""
    return unpack_unitypackage(exported / "unity" / "gsac-avatar.unitypackage")


def guid_of(meta):
    return re.search(r"^guid: ([0-9a-f]{32})$", meta, re.MULTILINE)[1]


def metas(upm):
    return {path.removesuffix(".meta"): content.decode() for path, content in upm.items() if path.endswith(".meta")}


def hidden(path):
    """Whether Unity passes over a path of a package."""
    return path.startswith("Documentation~") or path == "Samples~"


def person_of(unitypackage):
    """(path, GUID, content) of the one person in it."""
    (path, (own, content, _)), = ((path, entry) for path, entry in unitypackage.items() if path.endswith(".gsac"))
    return path, own, content


def unpack_unitypackage(path):
    with tarfile.open(path) as tar:
        raw = {entry.name: tar.extractfile(entry).read() for entry in tar if entry.isfile()}
    guids = {name.split("/")[0] for name in raw}
    return {raw[f"{g}/pathname"].decode(): (g, raw.get(f"{g}/asset"), raw[f"{g}/asset.meta"].decode()) for g in guids}


def test_every_file_and_folder_has_a_meta_and_every_meta_its_file(upm):
    files = {path for path in upm if not path.endswith(".meta")}
    folders = {str(parent) for path in files for parent in Path(path).parents} - {"."}
    assert set(metas(upm)) == {path for path in files | folders if not hidden(path)}


def test_guids_are_unique_and_the_same_in_both_forms(upm, unitypackage):
    guids = {path.removeprefix("Samples~/"): guid_of(meta) for path, meta in metas(upm).items()}
    assert len(set(guids.values())) == len(guids)
    installed = {path.removeprefix("Assets/Gsac").lstrip("/"): guid for path, (guid, _, meta) in unitypackage.items()}
    assert all(guid == guid_of(meta) for guid, _, meta in unitypackage.values())
    assert len(installed) == len(set(installed.values()))
    assert {p: g for p, g in installed.items() if p in guids}.items() <= guids.items()
    assert {p.split("/")[0] for p in installed.keys() - guids.keys()} == {"", "People"}


def test_guids_do_not_change_with_the_person_or_the_version(upm, figure, tmp_path):
    unity_package.write_unity(tmp_path, avatar_bytes(figure), "9.9.9")
    root = tmp_path / "com.gsac.avatar"
    other = {str(path.relative_to(root)): guid_of(path.read_text()) for path in root.rglob("*.meta")}
    assert other == {f"{path}.meta": guid_of(meta) for path, meta in metas(upm).items()}
    assert json.loads((root / "package.json").read_text())["version"] == "9.9.9"


def test_a_second_persons_package_overwrites_neither_the_first_person_nor_the_code(exported, unitypackage, figure, tmp_path):
    unity_package.write_unity(tmp_path, avatar_bytes(figure), version("gsac"))
    second = unpack_unitypackage(tmp_path / "gsac-avatar.unitypackage")
    (one, own, content), (other, others, container) = person_of(unitypackage), person_of(second)
    assert one != other and own != others and content != container
    assert {p: e for p, e in unitypackage.items() if p != one} == {p: e for p, e in second.items() if p != other}
    tarball = f"com.gsac.avatar-{version('gsac')}.tgz"
    assert (tmp_path / tarball).read_bytes() == (exported / "unity" / tarball).read_bytes(), "one name and version is one content"


def test_a_persons_guid_and_file_name_are_made_of_the_content_and_its_importer_is_ours(exported, unitypackage, upm):
    path, own, content = person_of(unitypackage)
    assert content == (exported / "avatar.gsac").read_bytes()
    assert own == person_guid(content) and path == f"Assets/Gsac/People/avatar-{own[:8]}.gsac"
    importer = re.search(r"script: \{fileID: 11500000, guid: (\w+), type: 3\}", unitypackage[path][2])[1]
    assert importer == guid_of(metas(upm)["Editor/GsacImporter.cs"])


def test_the_package_holds_nobody_and_what_a_studio_asks_for(upm, package):
    assert not any(content.startswith(b"GSAC") for path, content in upm.items() if not path.startswith("SelfCheck/"))
    manifest = json.loads(upm["package.json"])
    assert manifest["author"]["name"] and manifest["license"] == "Apache-2.0"
    assert upm["LICENSE.md"] == (package.resolve().parent / "LICENSE").read_bytes()
    assert f"## [{manifest['version']}]" in upm["CHANGELOG.md"].decode()
    assert any(path.startswith("Documentation~/") and path.endswith(".md") for path in upm)


def test_the_folder_of_the_sources_is_a_package_for_a_git_address(upm, package, tmp_path):
    for path in (*unity_package.SOURCES, *unity_package.PACKING):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
    unity_package.write_metas(tmp_path)
    made = {str(path.relative_to(tmp_path)): path.read_text() for path in tmp_path.rglob("*.meta")}
    committed = {str(path.relative_to(package)): path.read_text() for path in package.rglob("*.meta")}
    assert committed == made, "out of date: python -m gsac.unity.package"
    assert json.loads((package / "package.json").read_text()) == json.loads(upm["package.json"])


def test_the_tarball_is_the_folder(exported, upm):
    with tarfile.open(next((exported / "unity").glob("com.gsac.avatar-*.tgz"))) as tar:
        packed = {entry.name: tar.extractfile(entry).read() for entry in tar}
        assert {(entry.mtime, entry.uid, entry.uname) for entry in tar.getmembers()} == {(0, 0, "")}
    assert packed == {f"package/{path}": content for path, content in upm.items()}


def test_the_unitypackage_holds_the_code_the_demo_and_the_person(upm, unitypackage):
    installed = {path.removeprefix("Assets/Gsac/"): content for path, (_, content, _) in unitypackage.items()
                 if content is not None and not path.endswith(".gsac")}
    left_out = ("Documentation~/", "Tests/", "Samples~/", "package.json")
    wanted = {path: content for path, content in upm.items() if path.startswith("Samples~/Demo/") or not path.startswith(left_out)}
    assert installed == {path.removeprefix("Samples~/"): content for path, content in wanted.items() if not path.endswith(".meta")}


SCENES = [path for path in unity_package.SOURCES if path.endswith(".unity")]


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: Path(path).stem)
def test_a_scenes_references_resolve_inside_the_package(upm, scene):
    text = upm[scene].decode()
    known = {guid_of(meta): path for path, meta in metas(upm).items()}
    documents = {int(n): body for n, body in re.findall(r"^--- !u!\d+ &(\d+)\n(.*?)(?=^--- |\Z)", text, re.MULTILINE | re.DOTALL)}
    assert len(documents) == text.count("--- !u!"), "no number is given twice"
    used = set()
    for file_id, own in re.findall(r"\{fileID: (-?\d+)(?:, guid: ([^,}]+), type: 3)?\}", text):
        if own:
            used.add((int(file_id), known[own]))
        else:
            assert int(file_id) == 0 or int(file_id) in documents
    assert {(number, Path(path).suffix) for number, path in used} <= {(11500000, ".cs"), (4800000, ".shader")}
    assert (11500000, "Runtime/GsacCast.cs") in used, "people of the project, none of its own"
    assert not any(folder not in scene and path.startswith("Samples~/") for _, path in used for folder in [str(Path(path).parent)])
    for path in (path for _, path in used if path.endswith(".cs")):
        source = upm[path].decode()
        body = next(b for b in documents.values() if guid_of(metas(upm)[path]) in b)
        fields = body.split("m_EditorClassIdentifier: \n")[1]
        for field in re.findall(r"^  (\w+): ", fields, re.MULTILINE):
            declared = rf"SerializeField[^\n]*\n?[^\n]* {field}( = [^;\n]+)?;$"
            assert re.search(declared, source, re.MULTILINE), f"{path} has no serialized {field}"


def test_the_manifest_is_a_package_with_its_sample(upm):
    manifest = json.loads(upm["package.json"])
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"]) and manifest["name"] == "com.gsac.avatar"
    assert all(any(path.startswith(sample["path"] + "/") for path in upm) for sample in manifest["samples"])


def test_assemblies_are_named_apart_know_each_other_and_the_editor_is_kept_out_of_players(upm):
    assemblies = {Path(path).parent: json.loads(content) for path, content in upm.items() if path.endswith(".asmdef")}
    names = [assembly["name"] for assembly in assemblies.values()]
    assert len(set(names)) == len(names)
    for assembly in assemblies.values():
        foreign = set(assembly["references"]) - set(names)
        assert not foreign or assembly["defineConstraints"], f"{assembly['name']} needs {foreign}, which not every project has"
    for path, content in upm.items():
        if path.endswith(".cs"):
            own = next(assemblies[folder] for folder in Path(path).parents if folder in assemblies)
            assert ("Editor" in Path(path).parts) == (own["includePlatforms"] == ["Editor"]), path
            assert own["includePlatforms"] == ["Editor"] or b"UnityEditor" not in content, path


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
                     if path.is_file() and path.suffix not in (".py", ".pyc", ".meta")}


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
