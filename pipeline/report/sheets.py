"""The page's picture sections: each function reads one result and returns pictures and figures."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import cv2
import numpy as np

from gsac.avatar import rotation
from gsac.avatar.artifacts import frame_paths
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera_motion import find_moved, make_view, measure_sway
from gsac.avatar.frame_files import read_frame
from gsac.avatar.wholebody import BODY, FACE, FEET, HANDS
from gsac.avatar.yaw import turn_seen
from gsac.pipeline.report.drawing import draw_body, draw_keypoints, draw_reprojection, over_magenta
from gsac.pipeline.report.pictures import (
    EXACT,
    QUALITIES,
    SEEN,
    Picture,
    RunPictures,
    is_found,
    make_picture,
    shrink_to_fit,
    spread_evenly,
)
from gsac.pipeline.report.results import AbsentError, Results, number
from gsac.stages.counting import counted
from gsac.stages.frame_names import name_frames

CONTACT, KEYPOINTS, ALPHA, BODIES, HELDOUT, FACES = 12, 8, 8, 8, 8, 3
"""How many frames each sheet shows at most."""
WIDE, HIGH = 520, 640
"""Largest picture of a sheet, px."""
VIEWS_BYTES, FACE_BYTES = 160_000, 120_000
FACE_ROOM = 0.4
"""Room round a face's box for hair and chin, in units of its side."""
GAP = 4
"""px of white beside truth and render of a face."""
LEAST_MASK = 1e-4
"""A mask that covers less of the frame is empty."""
RIM = 2
"""Width of the frame's rim, px: a mask that reaches it is cut off there."""
PERSON_PX = 420
"""Height of the person at which the footage's sharpness is measured, px."""
PERSON_WHITE = 250
"""Least brightness that counts as a held-out picture's white ground."""


@dataclass
class Sheet:
    """Pictures of one section and the figures measured for it."""

    pictures: list[Picture]
    figures: dict[str, str] = field(default_factory=dict)
    """Name -> value, as read by people."""
    facts: dict[str, float] = field(default_factory=dict)
    """The same for `quality`."""
    columns: str = "large"
    """How the page lays the pictures out: small, large, wide, one, or native, which no screen enlarges."""
    parts: int = 1
    """Pictures side by side in each, of which the first is the truth and the second its render."""


def contact_sheet(run: RunPictures) -> Sheet:
    """Frames of the clip."""
    pictures = []
    for t in spread_evenly(len(run.frames), CONTACT):
        image = run.frame(t)
        shown = shrink_to_fit(image, 480 if image.shape[1] > image.shape[0] else 300, 400)
        pictures.append(make_picture(shown, run.moment(t), f"Frame {t} of the clip", 24_000, t))
    facts = {} if run.clip.timestamps_s or len(run.frames) == 1 else {"photos": float(len(run.frames))}
    return Sheet(pictures, facts=facts, columns="large" if shown.shape[1] > shown.shape[0] else "small")


def keypoint_sheet(run: RunPictures) -> Sheet:
    """Detected, filled and missing points over frames."""
    k = run.keypoints
    count = min(len(run.frames), len(k["xy"]))
    crop = run.crop(WIDE, HIGH)
    pictures = []
    for t in choose_frames(k, count):
        image = crop.cut(run.frame(t)).copy()
        draw_keypoints(image, crop.points(k["xy"][t]), k["score"][t], SEEN, k.get("filled", [None] * count)[t],
                       k.get("missing", [None] * count)[t])
        hands = ", ".join(f"{side} hand {hand_state(k, t, i, side)}" for i, side in enumerate(HANDS))
        pictures.append(make_picture(image, f"{run.moment(t)}: {hands}", f"Keypoints of frame {t}", frame=t))
    figures = {"Detector": str(k["detector"]), "Of stage": "handgap" if "filled" in k else "keypoints",
               "Frames": str(len(k["xy"]))}
    person = np.any(is_found(k)[:, BODY], 1)
    facts = {"person_share": float(person.mean()), "feet_share": share_of(person, np.any(is_found(k)[:, FEET], 1))}
    figures["Person found"] = percent(facts["person_share"])
    parts = {}
    for side, part in HANDS.items():
        parts[f"{side}_hand_share"] = f"{side.capitalize()} hand found", is_part_seen(k, part)
        if "filled" in k:
            parts[f"{side}_hand_filled"] = f"{side.capitalize()} hand filled", k["filled"][:, part].any(1)
    parts["face_share"] = "Face found", is_part_seen(k, FACE)
    if run.face_valid is not None:
        parts["face_used"] = "Face used for shape and expression", run.face_valid
    of = "" if person.all() else " of the frames with a person"
    for fact, (name, frames) in parts.items():
        facts[fact] = share_of(person, frames)
        figures[name] = percent(facts[fact]) + of
    return Sheet(pictures, figures, facts)


def share_of(person: np.ndarray, frames: np.ndarray) -> float:
    """The share of the frames with a person, (T,) bool, that is among others, (T,) bool; 0 without a person."""
    count = min(len(person), len(frames))
    return float(frames[:count][person[:count]].mean()) if person[:count].any() else 0.0


def is_part_seen(k: dict[str, np.ndarray], part: slice) -> np.ndarray:
    """(T,) bool: the part was found in the image, not filled. k: arrays of keypoints.npz, (T, 133, ...)."""
    return is_found(k)[:, part].mean(1) >= 0.5


def hand_state(k: dict[str, np.ndarray], t: int, i: int, side: str) -> str:
    """The word for hand i (0 left, 1 right) in frame t. k: arrays of keypoints.npz, (T, 133, ...)."""
    if "filled" in k and k["filled"][t, HANDS[side]].any():
        return "filled"
    if "missing" in k and k["missing"][t, i]:
        return "missing"
    return "found" if is_part_seen(k, HANDS[side])[t] else "not found"


def choose_frames(k: dict[str, np.ndarray], count: int) -> list[int]:
    """Frames to show: for each hand the middle one of those where it is filled, and of those where it is missing; the rest evenly.

    k: arrays of keypoints.npz, (T, 133, ...); count: frames there are.
    """
    frames: set[int] = set()
    if "filled" in k:
        for i, part in enumerate(HANDS.values()):
            filled = k["filled"][:count, part].any(1)
            for which in (filled, k["missing"][:count, i] & ~filled):
                hits = np.flatnonzero(which)
                frames |= {int(hits[len(hits) // 2])} if len(hits) else set()
    for t in sorted(spread_evenly(count, KEYPOINTS), key=lambda t: -min((abs(t - f) for f in frames), default=0)):
        if len(frames) < KEYPOINTS:
            frames.add(t)
    return sorted(frames)


def alpha_sheet(run: RunPictures) -> Sheet:
    """The person cut out, on magenta."""
    crop = run.crop(WIDE, HIGH)
    masks = {p.stem for p in frame_paths(run.results.path("segment/alpha"))}
    lacking = np.array([path.stem not in masks for path in run.frames])
    if lacking.all():
        raise AbsentError("segment/alpha has no mask for any frame.")
    chosen = np.flatnonzero(~lacking)
    chosen = chosen[spread_evenly(len(chosen), ALPHA)].tolist()
    torn = np.zeros(len(lacking), bool)
    pictures, covers, soft, looks, views, cut = [], [], [], [], [], []
    for t in chosen:
        try:
            alpha = run.alpha(t)
        except AbsentError:
            torn[t] = True
            continue
        looks.append(measure_light(run.frame(t), alpha))
        views.append(make_view(run.frame(t), alpha))
        cut.append(sides_touched(alpha))
        covers.append(float(alpha.mean()))
        soft.append(float(((alpha > 0.02) & (alpha < 0.98)).sum() / max((alpha >= 0.5).sum(), 1)))
        pictures.append(make_picture(over_magenta(crop.cut(run.frame(t)), crop.cut(alpha)),
                                f"{run.moment(t)}: covers {percent(covers[-1])}", f"Frame {t} cut out, on magenta", frame=t))
    if not pictures:
        raise AbsentError("No mask of segment/alpha can be read.")
    empty = [t for t, cover in zip([t for t in chosen if not torn[t]], covers, strict=True) if cover < LEAST_MASK]
    facts = {"empty_masks": float(run.person_found[empty].sum())}
    for name, values in zip(("brightness", "sharpness"), zip(*looks, strict=True), strict=True):
        if np.isfinite(values).any():
            facts[name] = float(np.nanmedian(values))
    facts["top_share"] = 1 - float(np.mean(["top" in sides for sides in cut]))
    figures = {"Frame covered, median": percent(float(np.median(covers))),
               "Soft edge, of the person's area": percent(float(np.median(soft)))}
    if any(cut):
        counts = Counter(side for sides in cut for side in sides)
        figures["Person at the picture's edge"] = ", ".join(f"{side} in {n} of {len(cut)}" for side, n in counts.items())
    if run.clip.timestamps_s:
        sway = measure_sway(views)
        facts["moved_frames"] = float(find_moved(sway, max(run.clip.width, run.clip.height)).sum())
        figures["Camera moved, among the frames shown"] = (
            f"{np.nanmax(sway):.0f} px" if np.isfinite(sway).any() else "not known: too plain a background")
    if lacking.any():
        figures["No mask, and not shown"] = name_frames(lacking)
    if torn.any():
        figures["Mask cannot be read, and not shown"] = name_frames(torn)
    if empty:
        figures["Empty masks among those shown"] = f"{len(empty)} of {len(covers)}"
    return Sheet(pictures, figures, facts)


def sides_touched(alpha: np.ndarray) -> list[str]:
    """Names of the picture's edges at which the person is cut off. alpha: (H, W) in 0..1."""
    rims = {"top": alpha[:RIM], "bottom": alpha[-RIM:], "left": alpha[:, :RIM], "right": alpha[:, -RIM:]}
    return [side for side, rim in rims.items() if (rim >= 0.5).any()]


def measure_light(image: np.ndarray, alpha: np.ndarray) -> tuple[float, float]:
    """Brightness of the person, 0..1, and sharpness: energy of the finest detail over that of all, the person PERSON_PX high.

    image: (H, W, 3) uint8; alpha: (H, W) in 0..1. NaN without a person.
    """
    rows = np.flatnonzero((alpha >= 0.5).any(1))
    if not len(rows):
        return float("nan"), float("nan")
    scale = min(1.0, PERSON_PX / (rows[-1] + 1 - rows[0]))
    grey, mask = (cv2.resize(np.asarray(x, np.float32), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
                  for x in (image.mean(2) / 255, alpha))
    inside = cv2.erode((mask >= 0.5).astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    if not inside.any():
        return float("nan"), float("nan")
    coarse = (np.stack(np.gradient(grey))[:, inside].astype(float) ** 2).sum()
    fine = (cv2.Laplacian(grey, cv2.CV_32F)[inside].astype(float) ** 2).sum()
    return float(grey[inside].mean()), float(fine / max(coarse, 1e-9))


def body_sheet(run: RunPictures) -> Sheet:
    """The fitted body over frames, with reprojection errors."""
    from gsac.avatar.zbuffer import rasterise

    params = BodyParams.read(run.results.path("smplx/body.npz"))
    body = Body.load()
    if params.model and params.model != body.digest:
        raise AbsentError(f"The body was fitted with a body model of your own ({params.model[:12]}), which this page does not "
                          "carry; it is drawn for the open body only.")
    crop = run.crop(WIDE, HIGH)
    k = run.keypoints
    height, width = run.frame(0).shape[:2]
    full = params.camera(width, height)
    camera = full.scaled(round(width * crop.scale), round(height * crop.scale))
    frames = spread_evenly(min(len(run.frames), params.frames, len(k["xy"])), BODIES)
    fitted = run.person_found[:params.frames] & ~params.lost[:len(run.frames)]
    pictures, overlaps, misses = [], [], [np.zeros(0)]
    for t in frames:
        vertices = body.posed(params, [t])[0][0]
        face_id = rasterise(vertices, body.faces, camera)[0]
        small = cv2.resize(run.frame(t), (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        projected = full.project(body.keypoints(vertices))
        shown = (k["score"][t] >= SEEN) & np.isfinite(projected).all(1) & np.isfinite(k["xy"][t]).all(1)
        image = draw_body(small, vertices, body.faces, face_id)
        scale = np.array((camera.width / width, camera.height / height))
        draw_reprojection(image, k["xy"][t] * scale, projected * scale, shown)
        caption = run.moment(t)
        if not fitted[t]:
            caption += ": not fitted" if run.person_found[t] else ": no person was found"
        else:
            misses.append(np.linalg.norm(k["xy"][t] - projected, axis=1)[: FEET.stop][shown[: FEET.stop]])
            if (overlap := silhouette_iou(run, t, face_id)) is not None:
                overlaps.append(overlap)
                caption += f": outline IoU {overlap:.2f}"
        x0, y0, x1, y1 = (round(v * crop.scale) for v in (crop.x0, crop.y0, crop.x1, crop.y1))
        pictures.append(make_picture(image[y0:y1, x0:x1], caption, f"Fitted body over frame {t}", frame=t))
    return body_figures(Sheet(pictures), body, params, fitted, np.concatenate(misses), overlaps)


def silhouette_iou(run: RunPictures, t: int, face_id: np.ndarray) -> float | None:
    """Intersection over union of the drawn body and the mask at 0.5; None without a mask. face_id: (H, W), -1 where no face."""
    try:
        alpha = run.alpha(t)
    except AbsentError:
        return None
    mask = cv2.resize(alpha, face_id.shape[::-1], interpolation=cv2.INTER_AREA) >= 0.5
    either = (mask | (face_id >= 0)).sum()
    return float((mask & (face_id >= 0)).sum() / either) if either else None


def body_figures(sheet: Sheet, body: Body, params: BodyParams, fitted: np.ndarray, misses: np.ndarray,
                 overlaps: list[float]) -> Sheet:
    """The sheet with its figures. fitted: (T,) bool, frames with a person and a fitted body; misses: (n,) px between detected and
    projected points; overlaps: silhouette IoUs."""
    rest = body.rest(params.betas)[0]
    turns = rotation.exp(params.global_orient[:len(fitted)][fitted].astype(float))
    sheet.facts = {"turn_degrees": turn_seen(turns), "height_m": float(np.ptp(rest[:, 1]))}
    sheet.figures = {"Height": f"{sheet.facts['height_m']:.2f} m", "Focal length": f"{params.focal[0]:.0f} px"}
    if len(misses):
        sheet.facts["reprojection_px"] = float(np.median(misses))
        sheet.figures["Joint reprojection, median of the frames shown"] = f"{sheet.facts['reprojection_px']:.1f} px"
    if overlaps:
        sheet.facts["outline_iou"] = float(np.mean(overlaps))
        sheet.figures["Outline IoU, mean of the frames shown"] = f"{sheet.facts['outline_iou']:.3f}"
    return sheet


def heldout_sheet(results: Results) -> Sheet:
    """Truth, render and error of held-out frames side by side, the worst one among them."""
    folder = results.path("train/heldout")
    frames = sorted(p.stem.removesuffix("_render") for p in folder.glob("*_render.png"))
    if not frames:
        raise AbsentError("No frame was held out, so nothing is compared.")
    rows = heldout_rows(results)
    chosen = {frames[i] for i in spread_evenly(len(frames), HELDOUT if len(frames) <= HELDOUT else HELDOUT - 1)}
    judged = [(rows[f]["psnr_fg"], f) for f in frames if number(rows.get(f, {}).get("psnr_fg")) is not None]
    worst = min(judged)[1] if judged else None
    triples = {stem: [read_frame(folder / f"{stem}_{kind}.png") for kind in ("truth", "render", "error")]
               for stem in sorted(chosen | ({worst} if worst else set()))}
    y, x = person_box([image for triple in triples.values() for image in triple[:2]])
    pictures = []
    for stem, triple in triples.items():
        shown = np.hstack([shrink_to_fit(image[y, x], 420, 540) for image in triple])
        pictures.append(make_picture(shown, heldout_caption(stem, rows.get(stem, {}), stem == worst),
                                f"Held-out frame {int(stem)}: truth, render, error", 70_000, int(stem)))
    return Sheet(pictures, heldout_figures(results), columns="wide", parts=3)


def face_sheet(results: Results) -> Sheet:
    """Faces of the best, the middle and the worst held-out frame that shows one, truth beside render, a pixel for a pixel."""
    folder, rows = results.path("train/heldout"), heldout_rows(results)
    shown = sorted((psnr, stem) for stem, row in rows.items()
                   if row.get("face_box") and (psnr := number(row.get("psnr_face"))) is not None)
    if not shown:
        raise AbsentError("No held-out frame shows the face, or an older version judged them.")
    pictures = []
    for psnr, stem in (shown[i] for i in reversed(spread_evenly(len(shown), FACES))):
        pair = [read_frame(folder / f"{stem}_{kind}.png") for kind in ("truth", "render")]
        y, x = face_area(rows[stem]["face_box"], *pair[0].shape[:2])
        beside = np.hstack([np.pad(image[y, x], ((0, 0), (0, GAP), (0, 0)), constant_values=255) for image in pair])
        words = f"frame {int(stem)}: truth and render, {psnr:.2f} dB in the face's box"
        pictures.append(make_picture(beside, words + (" (the worst of them)" if (psnr, stem) == shown[0] else ""),
                                     f"The face in held-out frame {int(stem)}, as filmed on the left, as drawn on the right",
                                     FACE_BYTES, int(stem), (EXACT, *QUALITIES)))
    return Sheet(pictures, columns="native", parts=2)


def face_area(box: list[int], height: int, width: int) -> tuple[slice, slice]:
    """Rows and columns of a face's box, x0 y0 x1 y1 px, with room round it, in a picture of that size."""
    x0, y0, x1, y1 = box
    room = round(FACE_ROOM * max(x1 - x0, y1 - y0))
    return slice(max(y0 - room, 0), min(y1 + room, height)), slice(max(x0 - room, 0), min(x1 + room, width))


def heldout_figures(results: Results) -> dict[str, str]:
    """How the held-out figures were measured, as far as metrics.json says."""
    try:
        metrics = results.metrics
    except AbsentError:
        return {}
    width, height = metrics.get("image_size") or (None, None)
    lpips, vgg_hed = metrics.get("lpips"), metrics.get("vgg_hed")
    lit = "drawn in the clip's own" if metrics.get("light") else "even"
    figures = {"Size judged": f"{width} x {height} px" if width else None,
               "Light": lit, "Trained on": metrics.get("trained_frames"),
               "Held out": len(metrics.get("heldout_frames") or []) or None,
               "LPIPS": "not measured (no weights)" if lpips is None else f"{lpips:.3f} ({metrics.get('lpips_net')})",
               "VGG features (HED)": None if vgg_hed is None else f"{vgg_hed:.3f} (no LPIPS)"}
    return {name: counted(value, "frame") if isinstance(value, int) else value for name, value in figures.items() if value}


def heldout_rows(results: Results) -> dict[str, dict]:
    """`000012` -> its row of metrics.json."""
    try:
        rows = results.metrics.get("heldout") or []
    except AbsentError:
        return {}
    return {f"{int(row['frame']):06d}": row for row in rows if isinstance(row, dict) and number(row.get("frame")) is not None}


def heldout_caption(stem: str, row: dict, worst: bool) -> str:
    """stem: `000012`; row: of metrics.json."""
    words = [f"frame {int(stem)}"]
    plain, aligned = number(row.get("psnr_fg")), number(row.get("psnr_fg_ttpo"))
    if plain is not None:
        words.append(f"{plain:.2f} dB on the person")
    if aligned is not None:
        words.append(f"{aligned:.2f} dB with the pose aligned at test time")
    return ", ".join(words) + (" (the worst frame)" if worst else "")


def person_box(images: list[np.ndarray], margin: int = 8) -> tuple[slice, slice]:
    """Rows and columns round all that is not white in any image; all where nothing is. images: (H, W, 3) uint8 each; margin: px."""
    marked = np.any([(image < PERSON_WHITE).any(2) for image in images], 0)
    box = []
    for axis, size in ((1, marked.shape[0]), (0, marked.shape[1])):
        hits = np.flatnonzero(marked.any(axis))
        box.append(slice(max(hits[0] - margin, 0), min(hits[-1] + margin + 1, size)) if len(hits) else slice(0, size))
    return box[0], box[1]


def views_sheet(results: Results) -> Sheet:
    """The avatar from all sides."""
    image = read_frame(results.path("train/heldout/views.png"))
    words = "front, right side, back; left side, from below, from above"
    return Sheet([make_picture(shrink_to_fit(image, 1440, 960), words, f"The avatar from {words}", VIEWS_BYTES)], columns="one")


def percent(x: float) -> str:
    """0.123 -> `12 %`"""
    return f"{100 * x:.0f} %" if x >= 0.095 or x == 0 else f"{100 * x:.1f} %"
