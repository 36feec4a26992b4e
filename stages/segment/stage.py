"""Entry of segment: the outlines of all frames, then their correction by the empty scene and the soft edges."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.camera_motion import View, find_moved, make_view, measure_sway
from gsac.avatar.frame_files import read_frame, write_alpha, write_image
from gsac.avatar.onnx_network import NetworkError
from gsac.avatar.sapiens import Sapiens
from gsac.avatar.threads import available_cores, prefetch
from gsac.stages.contract import BadInput, Job, StageError
from gsac.stages.counting import counted
from gsac.stages.findings import Code, Finding
from gsac.stages.missing_frames import read_keypoints
from gsac.stages.person_seen import find_seen
from gsac.stages.segment.bones import distance_to_bones
from gsac.stages.segment.brought import MASKS, hand_on, refuse_inverted
from gsac.stages.segment.components import keep_person, keep_soft_person
from gsac.stages.segment.config import Method
from gsac.stages.segment.correction import LIKELY, correct, find_lost, match_scene
from gsac.stages.segment.edge_network import CloseUp, find_alpha, open_edge_network
from gsac.stages.segment.grabcut import cut_out
from gsac.stages.segment.matting import settle
from gsac.stages.segment.network import PersonMask, PoseMask, SelfieMask, person_region
from gsac.stages.segment.plate import HALF, Plate, compare
from gsac.stages.segment.plate_from_video import learn_plate, relearn_plate

METHODS: dict[Method, Callable[[dict[str, Path]], PersonMask]] = {"pose": PoseMask, "selfie": SelfieMask, "sapiens": Sapiens}
"""segment.method -> its class, made from the model files."""
PLATE = "plate.png"
"""The empty scene, beside the frames."""
LABELS = "labels"
"""Folder of the alpha that holds a network's labels."""
WIDE = 0.25
"""Margin around the person in which the scene is compared with the plate, as a share of the person's height."""
REACH = 4
"""px about a corrected outline within which a soft alpha that was brought is found anew."""
LEAST = 0.05
"""Probability from which on a pixel may be the person."""
MOSTLY = 0.5
"""Least share of the frames that the plate of a video must fit for it to be learned again from their outlines."""


class Cutout(NamedTuple):
    """The person in a frame, before the soft edge; the picture is read again then, since all frames' would fill the memory."""

    box: tuple[int, int, int, int]
    """x0, y0, x1, y1 px of the part of the frame that `outline` is of."""
    outline: np.ndarray
    """(h, w) bool."""
    xy: np.ndarray
    """(133, 2) px from the part's corner."""
    score: np.ndarray
    """(133,)."""
    probability: np.ndarray
    """(h, w) uint8, the network's, 255: certainly the person."""
    soft: np.ndarray | None = None
    """(h, w) half in 0..1, the alpha of a network whose edge is soft already."""

    def on_frame(self, shape: tuple[int, ...]) -> np.ndarray:
        """(H, W) bool. shape: (H, W, ...) of the frame."""
        x0, y0, x1, y1 = self.box
        whole = np.zeros(shape[:2], bool)
        whole[y0:y1, x0:x1] = self.outline
        return whole


class Masked(NamedTuple):
    """What the network says of a frame."""

    t: int
    image: np.ndarray
    """(H, W, 3) uint8."""
    probability: np.ndarray | None = None
    """(H, W) of the person; None: the frame shows nobody."""
    labels: np.ndarray | None = None
    """(H, W), of a network that names the parts of the body."""


def run(job: Job) -> None:
    frames = job.inputs["split/frames"]
    paths = frame_paths(frames)
    keypoints, _ = read_keypoints(job.inputs["keypoints/keypoints.npz"], len(paths))
    clip = Clip.read(job.inputs["split/clip.json"])
    (job.out / "alpha").mkdir()
    if job.config.method == "brought":
        sway = use_brought(job, paths, keypoints)
    else:
        if (frames / MASKS).is_dir():
            job.note("Masks lie beside the footage and are not used; segment.method=brought takes them.")
        try:
            sway = Cutting(job, paths, keypoints, clip).run()
        except NetworkError as e:
            raise BadInput(str(e)) from e
    moved = find_moved(sway, max(clip.width, clip.height))
    if clip.timestamps_s is not None and moved.any():
        job.warn(Finding.of(Code.CAMERA_MOVES, moved, figure=np.nanmax(sway)))


def warm(device: str) -> None:
    """Reads the network of the soft edge, and loads the loops of its matting, or compiles them the very first time; called while a
    stage before is at work."""
    open_edge_network()
    settle(np.zeros((9, 9, 3), np.uint8), np.full((9, 9), 0.5, np.float32))


def use_brought(job: Job, paths: list[Path], keypoints: dict[str, np.ndarray]) -> np.ndarray:
    """Hands on the masks that came with the footage. paths: T frames; keypoints: their arrays (T, ...) by name. Returns (T,) px,
    how far the camera sways."""
    empty, inverted = np.zeros((2, len(paths)), bool)
    sway = measure_sway(count_views(job, hand_on(paths, job.out / "alpha", keypoints, empty, inverted), len(paths)))
    refuse_inverted(paths, inverted, keypoints["score"])
    if empty.all():
        raise StageError(f"frame 0 ({paths[0].name}) and all others: the mask that came with it shows nobody there")
    warn_of_empty(job, empty, keypoints["score"])
    return sway


def warn_of_empty(job: Job, empty: np.ndarray, score: np.ndarray) -> None:
    """Names the frames whose mask is empty though they show a person; of the others `keypoints` tells, or `smplx`.

    empty: (T,) bool, those masks; score: (T, 133) of the points.
    """
    unfound = empty & find_seen(score)
    if unfound.any():
        job.warn(Finding.of(Code.EMPTY_MASK, unfound))


def count_views(job: Job, views: Iterable[View], total: int) -> Iterator[View]:
    """Yields them, and tells how many there were."""
    for done, view in enumerate(views, 1):
        job.progress(done, total, "frames")
        yield view


class Cutting:
    """Finds the person in each frame of a clip and writes the masks."""

    def __init__(self, job: Job, paths: list[Path], keypoints: dict[str, np.ndarray], clip: Clip):
        """paths: T frames; keypoints: their arrays (T, ...) by name."""
        self.job, self.paths, self.keypoints, self.clip = job, paths, keypoints, clip
        self.network = METHODS[job.config.method](job.models)
        self.sapiens = self.network if isinstance(self.network, Sapiens) else None
        self.regions = {t: region for t, (xy, score) in enumerate(zip(keypoints["xy"], keypoints["score"], strict=True))
                        if (region := person_region(np.nan_to_num(xy), score)) is not None}
        """Frame -> where the network looks; frames without a person have none."""
        self.found: dict[int, np.ndarray] = {}
        """Frame -> probability (H, W) that the network has told already."""
        self.cutouts: dict[int, Cutout] = {}
        self.absent, self.unfound, self.fits = np.zeros((3, len(paths)), bool)
        """(T,) each: nobody in the mask; nobody though points of a person are there; the plate fits the frame."""
        self.given = (job.inputs["split/frames"] / PLATE).exists()
        self.learns = job.config.use_plate and clip.timestamps_s is not None and not self.given
        self.plate = self.first_plate()

    def run(self) -> np.ndarray:
        """Returns (T,) px, how far the camera sways."""
        if self.sapiens is not None:
            prepare_labels(self.job.out, self.paths, (self.clip.height, self.clip.width))
        with ThreadPoolExecutor(available_cores()) as pool:
            views = prefetch(pool, self.cut, self.read_masks(pool), available_cores())
            sway = measure_sway(count_views(self.job, views, len(self.paths)))
            if self.absent.all():
                raise StageError(describe_nobody(self.paths, self.unfound))
            if self.learns:
                still = self.stood_still(sway)
                self.plate = relearn_plate(self.paths, ~self.absent, self.outline) if still else None
            deque(pool.map(self.write_soft, range(len(self.paths))), maxlen=0)
        warn_of_empty(self.job, self.absent, self.keypoints["score"])
        other_scene = ~self.fits & ~self.absent
        if self.given and other_scene.any():
            self.job.warn(Finding.of(Code.OTHER_SCENE, other_scene))
        return sway

    def first_plate(self) -> Plate | None:
        """The empty scene that came with the footage, or what the network's first look at a video leaves of it."""
        if self.job.config.use_plate and self.given:
            image = read_frame(self.job.inputs["split/frames"] / PLATE)
            return Plate(image, np.ones(image.shape[:2], bool))
        if self.learns and self.sapiens is None:
            shown = np.isin(np.arange(len(self.paths)), list(self.regions))
            return learn_plate(self.paths, shown, lambda t, image: self.look(t, image) > LEAST)
        return None

    def look(self, t: int, image: np.ndarray) -> np.ndarray:
        """Frame t's probability, (H, W); kept for `read_masks`, which asks for it again. image: (H, W, 3) uint8."""
        self.found[t] = self.network(image, self.regions[t])
        return self.found[t]

    def read_masks(self, pool: ThreadPoolExecutor) -> Iterator[Masked]:
        """What the network says of each frame; it has threads of its own, so one thread feeds it."""
        for t, image in enumerate(prefetch(pool, read_frame, self.paths, 2)):
            if t not in self.regions:
                yield Masked(t, image)
            elif self.sapiens is not None:
                yield Masked(t, image, *self.sapiens.read(image))
            else:
                probability = self.found.pop(t, None)
                yield Masked(t, image, self.look(t, image) if probability is None else probability)

    def cut(self, masked: Masked) -> View:
        """Cuts the person out of a frame. Returns its scene, by which the camera's sway is measured."""
        t, image, probability, labels = masked
        self.absent[t] = probability is None
        if probability is None:
            return make_view(image, np.zeros(image.shape[:2], np.float32))
        xy, score = np.nan_to_num(self.keypoints["xy"][t]), self.keypoints["score"][t]
        if labels is None:
            self.cutouts[t], self.fits[t] = cut_frame(image, probability, xy, score, self.plate, self.job.config.iterations)
        else:
            self.cutouts[t], self.fits[t] = cut_soft_frame(image, probability, xy, score, self.plate)
            write_image(labels_of(self.job.out, self.paths[t]), keep_labels(labels, self.cutouts[t]))
        if not self.cutouts[t].outline.any():
            self.absent[t] = self.unfound[t] = True
        return make_view(image, self.outline(t, image).astype(np.float32))

    def outline(self, t: int, image: np.ndarray) -> np.ndarray:
        """(H, W) bool. image: (H, W, 3), frame t."""
        return self.cutouts[t].on_frame(image.shape)

    def stood_still(self, sway: np.ndarray) -> bool:
        """Whether the camera did, so that a plate can be learned from the outlines. sway: (T,) px."""
        if self.sapiens is not None:
            return not find_moved(sway, max(self.clip.width, self.clip.height)).any()
        return self.plate is not None and bool(self.fits[~self.absent].mean() >= MOSTLY)

    def write_soft(self, t: int) -> None:
        """Writes frame t's alpha with its soft edge."""
        if self.absent[t]:
            alpha = np.zeros((self.clip.height, self.clip.width), np.float32)
        else:
            alpha = finish(read_frame(self.paths[t]), self.cutouts.pop(t), self.plate)
        write_alpha(self.job.out / "alpha" / f"{self.paths[t].stem}.exr", alpha)


def labels_of(out: Path, frame: Path) -> Path:
    """Where a frame's labels lie."""
    return out / "alpha" / LABELS / f"{frame.stem}.png"


def prepare_labels(out: Path, paths: list[Path], shape: tuple[int, int]) -> None:
    """Writes labels that name nothing, for the frames in which nobody is. paths: T frames; shape: H, W of each."""
    (out / "alpha" / LABELS).mkdir()
    for path in paths:
        write_image(labels_of(out, path), np.zeros(shape, np.uint8))


def describe_nobody(paths: list[Path], unfound: np.ndarray) -> str:
    """What to say where every mask is empty. unfound: (T,) bool, frames in which there were points of a person, yet no mask."""
    if not unfound.any():
        return f"frame 0 ({paths[0].name}) and all others: no person was found, so every mask would be empty"
    first = int(np.flatnonzero(unfound)[0])
    return (f"frame {first} ({paths[first].name}): the mask is empty although a person was found there, and none of the "
            f"clip's {counted(len(paths), 'frame')} has one; look at the frames, and film one whole person, or try "
            "segment.method=selfie")


def cut_frame(image: np.ndarray, probability: np.ndarray, xy: np.ndarray, score: np.ndarray,
              plate: Plate | None, iterations: int) -> tuple[Cutout, bool]:
    """image: (H, W, 3) uint8; probability: (H, W); xy: (133, 2) px; score: (133,).

    Returns the person's outline, and whether the plate, if any, fits the frame.
    """
    box = around(probability)
    if box is None:
        return nobody(xy, score), True
    part = np.s_[box[1]: box[3], box[0]: box[2]]
    corner = np.array(box[:2])
    here = None
    if plate is not None:
        x0, y0, x1, y1 = around(probability, margin=WIDE)
        here = compare(image[y0:y1, x0:x1], half_of(plate, (x0, y0, x1, y1)), probability[y0:y1, x0:x1])
    if here is not None:
        here = here.part((box[0] - x0, box[1] - y0, box[2] - x0, box[3] - y0))
    xy = xy - corner
    outline = keep_person(cut_out(image[part], probability[part], xy, score, iterations, here), xy, score) > 0.5
    cutout = Cutout(box, outline, xy, score, to_bytes(probability[part]))
    return cutout, plate is None or here is not None


def cut_soft_frame(image: np.ndarray, alpha: np.ndarray, xy: np.ndarray, score: np.ndarray,
                   plate: Plate | None) -> tuple[Cutout, bool]:
    """image: (H, W, 3) uint8; alpha: (H, W) of all persons, with soft edges; xy: (133, 2) px; score: (133,).

    Returns the person's alpha and outline, and whether the plate, if any, fits the frame.
    """
    kept = keep_soft_person(alpha, xy, score)
    box = around(kept)
    if box is None:
        return nobody(xy, score), True
    part = np.s_[box[1]: box[3], box[0]: box[2]]
    fits = True
    if plate is not None:
        x0, y0, x1, y1 = wide = around(kept, margin=WIDE) or box
        fits = compare(image[y0:y1, x0:x1], half_of(plate, wide), kept[y0:y1, x0:x1]) is not None
    soft = kept[part]
    return Cutout(box, soft > 0.5, xy - box[:2], score, to_bytes(soft), soft.astype(np.float16)), fits


def nobody(xy: np.ndarray, score: np.ndarray) -> Cutout:
    """The cut-out of a frame that shows nobody. xy: (133, 2) px; score: (133,)."""
    return Cutout((0, 0, 0, 0), np.zeros((0, 0), bool), xy, score, np.zeros((0, 0), np.uint8))


def keep_labels(labels: np.ndarray, cutout: Cutout) -> np.ndarray:
    """labels: (H, W) uint8 of all that a frame shows. Returns those (H, W) of the person, 0 elsewhere."""
    kept = np.zeros_like(labels)
    if cutout.soft is not None:
        x0, y0, x1, y1 = cutout.box
        kept[y0:y1, x0:x1] = np.where(cutout.soft > 0, labels[y0:y1, x0:x1], 0)
    return kept


def to_bytes(probability: np.ndarray) -> np.ndarray:
    """probability: (...) 0..1. Returns it as uint8 (...), 255 for 1."""
    return (probability * 255 + 0.5).astype(np.uint8)


def close_up(image: np.ndarray, cutout: Cutout, plate: Plate | None) -> CloseUp:
    """What the network of the soft edge is shown: the outline corrected where the plate shows the frame's scene.

    image: (H, W, 3) uint8, the frame.
    """
    x0, y0, x1, y1 = cutout.box
    outline, part = cutout.outline, np.ascontiguousarray(image[y0:y1, x0:x1])
    bones = distance_to_bones(outline.shape, cutout.xy, cutout.score)
    scene = None if plate is None else match_scene(part, outline, plate.part(cutout.box))
    if scene is not None:
        outline = correct(part, outline, scene, bones, cutout.probability > LIKELY * 255)
    return CloseUp(part, outline, cutout.probability, scene, find_lost(outline, cutout.probability, bones))


def soften(seen: CloseUp) -> np.ndarray:
    """Alpha (h, w) float32 of the part that is seen."""
    return settle(seen.image, find_alpha(seen))


def finish(image: np.ndarray, cutout: Cutout, plate: Plate | None) -> np.ndarray:
    """Alpha (H, W) float32 of a frame: the outline, corrected where the plate shows the scene, with a soft edge.

    An edge that was soft already stays but where the outline was corrected. image: (H, W, 3) uint8, the frame.
    """
    alpha = np.zeros(image.shape[:2], np.float32)
    if not cutout.outline.any():
        return alpha
    x0, y0, x1, y1 = cutout.box
    seen = close_up(image, cutout, plate)
    if cutout.soft is None:
        alpha[y0:y1, x0:x1] = soften(seen)
        return alpha
    alpha[y0:y1, x0:x1] = cutout.soft
    corrected = (seen.outline != cutout.outline).astype(np.uint8)
    if corrected.any():
        near = cv2.dilate(corrected, np.ones((2 * REACH + 1, 2 * REACH + 1), np.uint8)) > 0
        alpha[y0:y1, x0:x1][near] = soften(seen)[near]
    return alpha


def half_of(plate: Plate, box: tuple[int, int, int, int]) -> Plate:
    """The part of a plate at half size. box: x0, y0, x1, y1 px at full size, of `around`."""
    x0, y0, x1, y1 = box
    return plate.half.part((x0 // HALF, y0 // HALF, x1 // HALF, y1 // HALF))


def around(probability: np.ndarray, least: float = LEAST, margin: float = 0.04) -> tuple[int, int, int, int] | None:
    """probability: (H, W). Returns x0, y0, x1, y1 px of what may be the person, with a margin of its height; None if nothing may.

    The numbers are even except at the frame's end.
    """
    rows, columns = np.flatnonzero((probability > least).any(axis=1)), np.flatnonzero((probability > least).any(axis=0))
    if len(rows) == 0:
        return None
    pad = int(margin * (rows[-1] - rows[0] + 1)) + 4
    height, width = probability.shape
    low = [max(0, int(first) - pad) // HALF * HALF for first in (columns[0], rows[0])]
    high = [min(end, -(-(int(last) + 1 + pad) // HALF) * HALF)
            for last, end in ((columns[-1], width), (rows[-1], height))]
    return low[0], low[1], high[0], high[1]
