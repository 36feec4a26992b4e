"""gsac bench protocol: trains and scores as another system was published, and prints our row beside the published ones.

Frames, masks and split are those that `gsac data import` wrote. Test frames train no gaussian and no pose; the body fit sees their
key points and masks, as the published fits did, or the poses that came with the data take its place. The row is mean and spread of
the trainings with several seeds. LPIPS is a dash without its weights (`gsac models add`).
"""

from __future__ import annotations

import json
from pathlib import Path

from gsac.benchmarks import training
from gsac.benchmarks.protocol.protocols import PROTOCOLS, Protocol
from gsac.pipeline.command_parser import CommandParser
from gsac.pipeline.data_sets.write import CAMERAS, SPLIT
from gsac.pipeline.model_check import check_model
from gsac.stages.contract import BadInput

GIVEN = "\nAll poses, of the test frames too, are those that came with the data."


def parser() -> CommandParser:
    out = CommandParser(prog="gsac bench protocol", description=(__doc__ or "").partition("\n")[0])
    out.add_argument("name", choices=sorted(PROTOCOLS), metavar="NAME", help=f"one of: {', '.join(sorted(PROTOCOLS))}")
    out.add_argument("clips", type=Path, nargs="+", metavar="DIR", help="folders that `gsac data import` wrote, one a subject")
    out.add_argument("--poses", default="fitted", choices=["fitted", "given"],
                     help="given: those that came with the data, in place of our body fit (default: fitted)")
    out.add_argument("--recipe", default="fast", choices=["fast", "paper"], help="recipe of the trainings (default: fast)")
    out.add_argument("--device", default="cpu", choices=["cpu", "cuda"], help="where training runs (default: cpu)")
    out.add_argument("--repeats", type=int, default=5, metavar="N", help="trainings of each, with seeds 0 to N-1 (default: 5)")
    out.add_argument("--steps", type=int, default=None, help="steps of a training (default: the recipe's)")
    out.add_argument("--gaussians", type=int, default=None, metavar="N", help="how many (default: train.gaussians=auto)")
    out.add_argument("--set", action="append", default=[], metavar="STAGE.KEY=VALUE", dest="sets",
                     help="a parameter up to the body fit, as of `gsac run`; may be repeated")
    out.add_argument("--out", type=Path, default=Path("bench-protocol"), metavar="DIR", help="default: ./bench-protocol")
    return out


def main(argv: list[str] | None = None) -> int:
    options = parser().parse_args(argv)
    from gsac.benchmarks.protocol import table
    from gsac.pipeline.journal import plain_journal

    say, protocol = plain_journal(), PROTOCOLS[options.name]
    if options.repeats < 1:
        raise BadInput(f"--repeats {options.repeats}: expected 1 or more")
    names = [folder.resolve().name for folder in options.clips]
    if len(set(names)) < len(names):
        raise BadInput(f"two folders are called {next(n for n in names if names.count(n) > 1)}; each subject's row needs a name of "
                       "its own")
    clips = {folder.resolve(): read_split(folder) for folder in options.clips}  # a wrong one is told before hours pass
    rows: dict[str, list[dict]] = {}
    values = {"steps": options.steps, "recipe": options.recipe, "device": options.device}
    values |= {} if options.gaussians is None else {"gaussians": options.gaussians}
    given = options.poses == "given"
    taken = {folder: take_poses(folder) if given else () for folder in clips}
    variant = f"{options.name}-{options.poses}" if given else options.name
    for folder, split in clips.items():
        case = training.fit_clip(options.out, folder, variant, say,
                                 (*settings(folder, split, protocol), *taken[folder], *options.sets))
        for seed in range(options.repeats):
            out = options.out / "trainings" / f"{case.name}_{seed}"
            found = training.train(case, out, seed=seed, heldout_frames=number_test(split), **values)
            rows.setdefault(folder.name, []).append(found)
            say.note(f"{folder.name}, seed {seed}: {table.cells([found], protocol)}")
    words = table.text(rows, protocol) + (GIVEN if given else "")
    print(words)
    (options.out / f"{variant}.txt").write_text(words + "\n")
    return 0


def read_split(folder: Path) -> dict:
    """split.json of a folder that was imported. Raises BadInput where it names no test frames."""
    split = read_imported(folder / SPLIT, {"fps": (int, float), "train": list, "test": list})
    if not split["test"] or not split["train"]:
        raise BadInput(f"{folder / SPLIT}: names no frames to test; this subject has no published split")
    return split


def read_imported(path: Path, kinds: dict[str, type | tuple[type, ...]]) -> dict:
    """The content of a JSON file that `gsac data import` wrote. kinds: of its fields. Raises BadInput where it is another."""
    if not path.is_file():
        raise BadInput(f"{path}: is missing; give a folder that `gsac data import` wrote")
    try:
        content = json.loads(path.read_text())
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}: is not readable as JSON ({error}); import the data again") from error
    if not isinstance(content, dict) or not all(isinstance(content.get(name), kind) for name, kind in kinds.items()):
        raise BadInput(f"{path}: is not what `gsac data import` writes; expected {', '.join(kinds)}. Import the data again")
    return content


def settings(folder: Path, split: dict, protocol: Protocol) -> tuple[str, ...]:
    """`stage.key=value` up to the body fit: every frame, whole, at the protocol's height, with its masks, time and focal length."""
    height = "null" if protocol.height is None else str(protocol.height)
    out = ["segment.method=brought", f"split.photo_fps={split['fps']}", "split.count=null", "split.crop=false",
           f"split.max_height={height}"]
    cameras = folder / CAMERAS
    if cameras.is_file():
        camera = read_imported(cameras, {"height": int, "focal": list})
        scale = 1.0 if protocol.height is None else min(1.0, protocol.height / camera["height"])
        out.append(f"smplx.focal_px={scale * sum(camera['focal']) / 2}")
    return tuple(out)


def take_poses(folder: Path) -> tuple[str, ...]:
    """Adds the poses of a folder that was imported to the model files; returns the settings that take them as the body fit. Raises
    BadInput where none were given."""
    from gsac.cache.store import Store
    from gsac.pipeline.model_store import ModelStore

    path, name = folder / "poses.npz", f"{folder.name}-poses"
    if not path.is_file():
        raise BadInput(f"{path}: is missing; no poses came with these data, use --poses fitted")
    check_model(name, path)
    ModelStore(Store.open()).add(name, path, force=True)
    return f"smplx.start={name}", "smplx.method=brought"


def number_test(split: dict) -> str:
    """`train.heldout_frames`: numbers of the test frames among all, as split numbers them."""
    order = {name: at for at, name in enumerate(sorted({*split["train"], *split["test"]}, key=int))}
    return ",".join(str(order[name]) for name in split["test"])
