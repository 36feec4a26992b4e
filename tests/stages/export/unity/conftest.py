"""The unity package's tests: helpers of this folder as fixtures, and the words for what is missing on a machine."""

import importlib.util
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def helper(name):
    spec = importlib.util.spec_from_file_location(f"gsac_unity_{name}", HERE / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def hlsl():
    """The module gpu.py, where its Debian packages are there."""
    module = helper("gpu")
    missing = module.missing_packages()
    if missing:
        pytest.skip(f"needs the Debian packages {', '.join(missing)}")
    return module


@pytest.fixture(scope="session")
def gpu(hlsl):
    pytest.importorskip("wgpu", reason="needs the package wgpu (pip install gsac[dev])")
    return hlsl.Gpu()


@pytest.fixture(scope="session")
def packing():
    return helper("packing")


@pytest.fixture(scope="session")
def shaders():
    """Folder of the package's HLSL."""
    from gsac.stages import export

    return Path(export.__file__).parent / "unity" / "Runtime" / "Resources" / "Gsac"


@pytest.fixture(scope="session")
def kernels(hlsl, shaders, tmp_path_factory):
    """Kernel name -> Program, and the tests' own BindParts."""
    folder = tmp_path_factory.mktemp("spirv")
    names = ("Skin", "Bind", "Keys", "SortBlocks", "SortAcross", "SortMerge")
    sources = {name: shaders / "Gsac.compute" for name in names} | {"BindParts": HERE / "parts.compute"}
    return {name: hlsl.Program(hlsl.compile_hlsl(source, name, "comp", folder, [shaders]), name)
            for name, source in sources.items()}


@pytest.fixture(scope="session")
def mono():
    """The module mono.py, where its Debian packages are there."""
    module = helper("mono")
    missing = module.missing_packages()
    if missing:
        pytest.skip(f"needs the Debian packages {', '.join(missing)}")
    return module


@pytest.fixture(scope="session")
def package():
    """Folder of the package's sources."""
    from gsac.stages import export

    return Path(export.__file__).parent / "unity"


@pytest.fixture(scope="session")
def programs_folder():
    """Folder of the tests' own C# programs."""
    return HERE / "programs"
