"""Unity's `.meta` files: each file and folder of a package needs one, with a GUID that never changes."""

from __future__ import annotations

import hashlib
from pathlib import PurePosixPath

PACKAGE = "com.gsac.avatar"
_TAIL = "  externalObjects: {}\n  userData: \n  assetBundleName: \n  assetBundleVariant: \n"
_IMPORTERS = {
    ".cs": "MonoImporter:\n  externalObjects: {}\n  serializedVersion: 2\n  defaultReferences: []\n  executionOrder: 0\n"
           "  icon: {instanceID: 0}\n  userData: \n  assetBundleName: \n  assetBundleVariant: \n",
    ".compute": "ComputeShaderImporter:\n" + _TAIL,
    ".shader": "ShaderImporter:\n  externalObjects: {}\n  defaultTextures: []\n  nonModifiableTextures: []\n  userData: \n"
               "  assetBundleName: \n  assetBundleVariant: \n",
    ".hlsl": "ShaderIncludeImporter:\n" + _TAIL,
    ".asmdef": "AssemblyDefinitionImporter:\n" + _TAIL,
    ".md": "TextScriptImporter:\n" + _TAIL,
    ".bytes": "TextScriptImporter:\n" + _TAIL,
    ".unity": "DefaultImporter:\n" + _TAIL,
}
_PACKAGE_JSON = "PackageManifestImporter:\n" + _TAIL


def guid(path: str) -> str:
    """The GUID of a path inside the package, 32 hex digits; "" is the package's own folder."""
    return hashlib.sha256(f"{PACKAGE}/{path}".encode()).hexdigest()[:32]


def file_meta(path: str) -> str:
    """The `.meta` text of a file; path: inside the package."""
    importer = _PACKAGE_JSON if path == "package.json" else _IMPORTERS[PurePosixPath(path).suffix]
    return f"fileFormatVersion: 2\nguid: {guid(path)}\n{importer}"


def folder_meta(path: str) -> str:
    """The `.meta` text of a folder; path: inside the package."""
    return f"fileFormatVersion: 2\nguid: {guid(path)}\nfolderAsset: yes\nDefaultImporter:\n{_TAIL}"
