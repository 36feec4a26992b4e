"""Unity's `.meta` files: each file and folder of a package needs one, with a GUID that never changes."""

from __future__ import annotations

import hashlib
from pathlib import PurePosixPath

PACKAGE = "com.gsac.avatar"
_TAIL = "  externalObjects: {}\n  userData: \n  assetBundleName: \n  assetBundleVariant: \n"
_TEXT = "TextScriptImporter:\n" + _TAIL
_ANY = "DefaultImporter:\n" + _TAIL
_IMPORTERS = {
    ".cs": "MonoImporter:\n  externalObjects: {}\n  serializedVersion: 2\n  defaultReferences: []\n  executionOrder: 0\n"
           "  icon: {instanceID: 0}\n  userData: \n  assetBundleName: \n  assetBundleVariant: \n",
    ".compute": "ComputeShaderImporter:\n" + _TAIL,
    ".shader": "ShaderImporter:\n  externalObjects: {}\n  defaultTextures: []\n  nonModifiableTextures: []\n  userData: \n"
               "  assetBundleName: \n  assetBundleVariant: \n",
    ".hlsl": "ShaderIncludeImporter:\n" + _TAIL,
    ".asmdef": "AssemblyDefinitionImporter:\n" + _TAIL,
    ".md": _TEXT,
    ".json": _TEXT,
    ".py": _ANY,
    ".unity": _ANY,
}
_PACKAGE_JSON = "PackageManifestImporter:\n" + _TAIL
_PERSON = ("ScriptedImporter:\n  internalIDToNameTable: []\n  externalObjects: {{}}\n  serializedVersion: 2\n  userData: \n"
           "  assetBundleName: \n  assetBundleVariant: \n  script: {{fileID: 11500000, guid: {importer}, type: 3}}\n")
IMPORTER = "Editor/GsacImporter.cs"
"""The script by which Unity reads .gsac files."""


def guid(path: str) -> str:
    """The GUID of a path inside the package, 32 hex digits; "" is the package's own folder."""
    return hashlib.sha256(f"{PACKAGE}/{path}".encode()).hexdigest()[:32]


def person_guid(container: bytes) -> str:
    """The GUID of a person, 32 hex digits: of the content alone. container: the bytes of avatar.gsac."""
    return guid(f"person/{hashlib.sha256(container).hexdigest()}")


def file_meta(path: str) -> str:
    """The `.meta` text of a file; path: inside the package."""
    suffix = PurePosixPath(path).suffix
    importer = _PACKAGE_JSON if path == "package.json" else _person_importer() if suffix == ".gsac" else _IMPORTERS[suffix]
    return f"fileFormatVersion: 2\nguid: {guid(path)}\n{importer}"


def person_meta(container: bytes) -> str:
    """The `.meta` text of a person's .gsac file, whatever its name."""
    return f"fileFormatVersion: 2\nguid: {person_guid(container)}\n{_person_importer()}"


def _person_importer() -> str:
    return _PERSON.format(importer=guid(IMPORTER))


def folder_meta(path: str) -> str:
    """The `.meta` text of a folder; path: inside the package."""
    return f"fileFormatVersion: 2\nguid: {guid(path)}\nfolderAsset: yes\n{_ANY}"
