"""The unity package's tests: helpers of this folder as fixtures, and the words for what is missing on a machine."""

from pathlib import Path

import pytest

from gsac import unity
from gsac.avatar.gsac_file.write import avatar_bytes
from support import mono as mono_runtime

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def hlsl():
    """The benchmark's compiler of the package's HLSL, where its Debian packages are there."""
    from gsac.benchmarks.unity import gpu, shaders

    missing = shaders.missing_packages() + gpu.missing_packages()
    if missing:
        pytest.skip(f"needs the Debian packages {', '.join(missing)}")
    return shaders


@pytest.fixture(scope="session")
def gpu(hlsl):
    pytest.importorskip("wgpu", reason="needs the package wgpu (pip install gsac[dev])")
    from gsac.benchmarks.unity.gpu import Gpu

    return Gpu()


@pytest.fixture(scope="session")
def kernels(hlsl, tmp_path_factory):
    """Kernel name -> Program, and the tests' own BindParts."""
    folder = tmp_path_factory.mktemp("spirv")
    sources = dict.fromkeys(hlsl.KERNELS, hlsl.CORE / "Gsac.compute")
    sources |= {hlsl.JOIN: hlsl.CORE / "GsacJoin.compute", "BindParts": HERE / "parts.compute"}
    return {name: hlsl.compile_hlsl(source, name, "comp", folder) for name, source in sources.items()}


@pytest.fixture(scope="session")
def mono():
    """The module mono.py, where its Debian packages are there."""
    missing = mono_runtime.missing_packages()
    if missing:
        pytest.skip(f"needs the Debian packages {', '.join(missing)}")
    return mono_runtime


@pytest.fixture(scope="session")
def package():
    """Folder of the package's sources."""
    return Path(unity.__file__).parent


@pytest.fixture(scope="session")
def programs_folder():
    """Folder of the tests' own C# programs."""
    return HERE / "programs"


@pytest.fixture(scope="session")
def play(mono, package, tmp_path_factory):
    """Runs a command of programs/Play.cs."""
    exe = mono.compile_package(package, tmp_path_factory.mktemp("scripts"))
    return lambda *args, **options: mono.run(exe, *args, **options)


@pytest.fixture(scope="session")
def files(figure, exported, tmp_path_factory):
    """figure.gsac: the small figure; person.gsac: an exported person, in a light; numbers: a pose and weights for each."""
    from dataclasses import replace

    import numpy as np

    from gsac.avatar.gsac_file.rigged import RiggedAvatar

    folder = tmp_path_factory.mktemp("files")
    rng = np.random.default_rng(2)
    (folder / "figure.gsac").write_bytes(avatar_bytes(figure))
    light = np.float32([[.8, .75, .7], [.3, .2, -.1], [.2, .1, .3], [.25, -.6, .2]])
    avatar = RiggedAvatar.read(exported / "avatar.gsac")
    (folder / "person.gsac").write_bytes(avatar_bytes(replace(avatar, gaussians=replace(avatar.gaussians, light=light))))
    for name, count in (("figure", 2), ("person", 52)):
        pose, transl = rng.normal(size=165) * .3, rng.normal(size=3) * .2
        np.savetxt(folder / f"{name}.txt", np.concatenate([pose, transl, rng.random(count) * .6]).astype(np.float32)[None], "%.9g")
    return folder


@pytest.fixture(scope="session")
def passes(hlsl, tmp_path_factory):
    """Render pipeline -> (vertex, fragment) of the package's shader; `stereo`: the built-in one's for two eyes at once."""
    texts = hlsl.shader_passes()
    stand_ins = dict.fromkeys(texts, HERE / "shims") | {"stereo": hlsl.STEREO}
    return {pipeline: hlsl.compile_pass(text, tmp_path_factory.mktemp("pass"), stand_ins[pipeline])
            for pipeline, text in (texts | {"stereo": texts[""]}).items()}


@pytest.fixture(scope="session")
def given(files):
    """name -> avatar, pose (55, 3), transl, weights with the jaw's share, as the numbers of `files` say."""
    import numpy as np

    from gsac.avatar.gsac_file.rigged import RiggedAvatar

    def read(name):
        avatar = RiggedAvatar.read(files / f"{name}.gsac")
        numbers = np.loadtxt(files / f"{name}.txt").astype(np.float32)
        pose = numbers[:165].reshape(55, 3)
        return avatar, pose, numbers[165:168], numbers[168:] + avatar.jaw_actions @ pose[22]

    return read
