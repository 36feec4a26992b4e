"""What stages find wrong with a clip: every code with its sentence, its severity, and what the person who filmed can do."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from gsac.stages.frame_names import name_frames
from gsac.stages.severity import Severity


@dataclass(frozen=True)
class Wording:
    """What a code says."""

    sentence: str
    """Format string; `{frames}` are the frames concerned as `name_frames` has them, `{figure}` the figure."""
    advice: str = ""
    """What to do, as a person would say it."""
    severity: Severity = Severity.POORER


class Code(Enum):
    """Everything that a stage may warn of."""

    ONE_FRAME = Wording("{name} gives one frame: the avatar will be right from one side only.", "Record a full turn.")
    PHOTOS_DROPPED = Wording("{given} photos given, {figure} kept evenly (split.count is {count}).", severity=Severity.NEWS)
    PHOTOS_UNREAD = Wording("{figure} of {given} photos left out: {reasons}")
    PHOTO_SIZES = Wording("{figure} of {given} photos have another size than {width}x{height} and were scaled to it: {names}.",
                          "Use one camera that stands still, and photos that nobody cropped.")
    PHOTO_ZOOM = Wording("the photos' focal lengths differ ({least:.0f} to {most:.0f} px): was the zoom moved? Their median is "
                         "used.", "Do not zoom between photos.")
    VIDEO_TRUNCATED = Wording("{name} is truncated: its header promises {declared} frames and {figure} are there. Those are used.",
                              "Copy the file from the phone again.")
    VIDEO_DAMAGED = Wording("{name} is damaged: {figure} of the {given} frames to keep do not decode and are left out.",
                            "Copy the file from the phone again.")
    VIDEO_BROKEN = Wording("{name}: ffmpeg met errors while decoding, so some frames may look broken: {error}",
                           severity=Severity.WRONG)
    NO_PERSON = Wording("No person was found in {frames}; these frames carry no points.")
    HARDLY_ANY_PERSON = Wording("A person shows in {figure:.0f} of the clip's {given} frames only: no avatar can come of that.",
                                "Film one whole person from head to feet, in the picture all the time.", Severity.HOPELESS)
    SMALL_PERSON = Wording("The person is only {figure:.0f} px tall in the picture: the avatar will be coarse.",
                           "Go closer, or turn the phone upright, until the person fills most of the picture's height.")
    LIES_ON_SIDE = Wording("The person lies on the side in {frames}: was the phone held across?",
                           "Turn the clip by a quarter in the phone's gallery, so that the person stands, and give it again.",
                           Severity.WRONG)
    SECOND_PERSON = Wording("A second person was seen in {frames}; {followed} is followed.",
                            "Keep others out of the picture or cut these frames.")
    CUT_OFF = Wording("The edge of the picture cuts off {parts}; what lies outside is guessed.",
                      "Stand in the middle, and farther away if head, hands and feet do not fit into the picture.")
    HAND_NEVER_DETECTED = Wording("The {side} hand was never seen; its fingers stay at rest.", "Show both hands, fingers apart.")
    FACE_NEVER_DETECTED = Wording("The face was never seen from the front; it stays without expression.",
                                  "Look into the camera for a second.")
    HAND_NEVER_SEEN = Wording("The {side} hand was never seen well enough; its pose is a guess.",
                              "Show both hands, fingers apart.")
    HAND_MISPLACED = Wording("The {side} hand was detected in a wrong place in {frames}; those detections are not used.")
    HAND_NOT_FILLED = Wording("The {side} hand is missing in {frames}, too long to fill.", "Keep the hands in sight.")
    POINTS_MISSING = Wording("keypoints.npz lacks {frames}; nothing counts as seen there.", "Run keypoints again, or bring all "
                             "points.", Severity.WRONG)
    MASK_MISSING = Wording("The mask of {frames} is missing; the body is fitted to the points alone there.",
                           "Run segment again, or bring all masks.", Severity.WRONG)
    MASK_BESIDE = Wording("The mask of {frames} lies beside the person, as the points show them.",
                          "Masks that you bring are white where the person is and black elsewhere, each one its own frame's: look "
                          "whether they are inverted, shifted or of another clip.", Severity.WRONG)
    EMPTY_MASK = Wording("The mask of {frames} is empty although a person was found there.")
    OTHER_SCENE = Wording("The plate does not show the scene of {frames} (did the camera move?); it is not used there.")
    CAMERA_MOVES = Wording("The camera moves by up to {figure:.0f} px, in {frames}.",
                           "Stand the phone on something firm, and do not zoom.", Severity.WRONG)
    FACE_AT_REST = Wording("The face was never seen from the front; the avatar's face stays at rest.")
    JAW_ALONE = Wording("This body model has no named facial actions: of the face only the jaw is carried over; a FLAME head "
                        "(face.flame) would bring the rest.")
    FLAME_LEFT_OUT = Wording("FLAME's expression goes into this body by the vertices that both share, and these were not given; "
                             "of the face only the jaw is carried over.", "Give smplx.flame and smplx.flame_ids.")
    ODD_FOCAL = Wording("The focal length given, {given:.0f} px, is {figure:.2f} times the picture's longer side, as hardly any "
                        "phone's is: if it is wrong, so is the body.", "Leave it out, and it is found from the person.")
    FOCAL_NOT_BELIEVED = Wording("The focal length given, {given:.0f} px, contradicts the pictures; {figure:.0f} px, as the person "
                                 "shows it, is used.", "Leave it out.", Severity.NEWS)
    PAPER_START = Wording("smplx.method paper starts from trunk and hanging arms; the publication starts from Hand4Whole's "
                          "regression", severity=Severity.NEWS)
    START_INTERPOLATED = Wording("The poses that you brought lack {frames}; they start from their neighbours'.",
                                 severity=Severity.NEWS)
    START_DOUBTED = Wording("The poses that you brought put the trunk in a wrong place in {frames}; the fit starts "
                            "there from trunk and hanging arms.",
                            "If these are many, check the poses' axes: x right, y down, z away.", Severity.NEWS)
    PAPER_NO_HEAD = Wording("face.npz holds no head mesh, for no face was seen; the paper's face terms (vertex, Laplacian, edge) "
                            "are off", severity=Severity.NEWS)
    NOT_FITTED = Wording("Not fitted, and not learned from: {frames}; {reason}.", severity=Severity.WRONG)
    PART_HIDDEN = Wording("Something that stands before the person hides {parts}; what is behind it is not fitted to the pictures.",
                          "Film where nothing stands between the person and the camera.")
    POORLY_COVERED = Wording("The body covers the silhouette badly (IoU down to {figure:.2f}) in {frames}: wide clothes, a mask "
                             "that holds more than the person, or several moments in one picture.",
                             "Wear clothes that lie close to the body, and turn slower.")
    CLOTHES_HIDE_SHAPE = Wording("Clothes hide the body's shape: they stand up to {figure:.0f} cm off it.",
                                 "Wear clothes that lie close to the body.")
    HAND_HIDDEN = Wording("The {side} hand is hidden in {frames}, behind the body as the camera sees it; where it lies is a guess.",
                          "Keep the hands beside the body.")
    ARM_DOUBTFUL = Wording("The {side} arm is doubtful in {frames}: the pictures do not show it as fitted.",
                           "Let the arms hang a little away from the body, hands in sight.")
    LEGS_DOUBTFUL = Wording("The person sways over the feet, which is hardly seen along the view: there the feet may be off by "
                            "{figure:.0f} cm in {frames}.", "Turn with small steps, hips over the feet.")
    MASK_NOT_TRAINED = Wording("The mask is empty or missing in {frames}; not trained on.")
    POSE_NOT_TRAINED = Wording("The body could not be fitted in {frames}; not trained on, not judged.")
    NOT_MEASURED = Wording("No frame is held out (usable frames: {figure}, train.holdout is {holdout}): the quality of this avatar "
                           "is not measured.", severity=Severity.NEWS)
    PART_OF_TURN = Wording("The frames show the person from {figure:.0f} of 360 degrees; the rest of the avatar is made up from "
                           "that.", "Record a full turn.")
    NO_LPIPS = Wording("LPIPS takes no part in the loss: {why}.", severity=Severity.NEWS)
    PART_UNSEEN = Wording("No frame shows the {parts}; the avatar has there the colours of what lies around.")
    LITTLE_SEEN = Wording("The frames show {figure:.0%} of the body's surface; the rest has the colours of what lies around it.")
    NO_CHECKPOINT = Wording("No checkpoint can be written to {folder} ({error}); should this run be stopped, the next one starts "
                            "anew.", severity=Severity.NEWS)
    CHECKPOINT_UNREADABLE = Wording("The checkpoint {path} cannot be read ({error}); training starts anew.", severity=Severity.NEWS)
    FROZEN = Wording("The picture stands still in {frames} while time goes on; these frames are not used.",
                     "Unless you held still there, film again without pausing, with no other program open on the phone.",
                     Severity.WRONG)
    NOTHING_MOVES = Wording("Nothing moves in all {figure} frames: the clip shows no more than one photo would.",
                            "Turn once round while the phone films, with no other program open on it.", Severity.WRONG)
    TURNED_UPRIGHT = Wording("The person {lies} in the footage; it was turned by {way}.",
                             "Turn the clip in the phone's gallery if that is wrong.", Severity.NEWS)
    MIRRORED = Wording("The picture is mirrored in {frames}; these frames are {treated}.",
                       "Give one recording, without cuts and effects.", Severity.NEWS)
    REPEATED = Wording("Pictures repeat in {frames}; these frames are not used.",
                       "Send the file as the phone recorded it, not a copy with another frame rate.", Severity.NEWS)
    SCENE_CUT = Wording("Another scene begins in {frames}.", "Give one shot, from one stand.", Severity.WRONG)
    SCENES_LEFT_OUT = Wording("The clip is cut together of {figure} scenes; only {first:.1f} to {last:.1f} s are used, the longest "
                              "one that shows a person.", "Give one shot, from one stand.", Severity.WRONG)
    EXPOSURE_STEPS = Wording("Exposure or white balance is off by up to {figure:.0%} in {frames}.",
                             "Lock exposure and focus before the turn: hold a finger on the person in the picture.")
    BLURRED = Wording("The picture is blurred in {frames}.",
                      "Clean the lens, let the phone focus on the person, film in more light and turn slower.")
    SIDES_EXCHANGED = Wording("Left was taken for right in {frames}; the sides are exchanged there.", severity=Severity.NEWS)
    TURN_JUMPS = Wording("The turn jumps in {frames}, by pictures out of order or a fast turn; each is fitted alone there.",
                         "Give one recording without cuts, and turn evenly and slowly.", Severity.NEWS)
    TURNED_OVER = Wording("The body may face the wrong way in {frames}: a front between backs.",
                          "Tie long hair back, give one recording without cuts, and turn evenly and slowly.")
    OTHER = Wording("{what}")
    """Of a stage that is not of this package."""

    @property
    def word(self) -> str:
        """Its name in JSON."""
        return self.name.lower()


@dataclass(frozen=True)
class Finding:
    """A code as it was met in one clip."""

    code: Code
    message: str
    """The sentence, filled in, and what to do."""
    frames: list[list[int]] = field(default_factory=list)
    """Runs of frames concerned, [first, last]; empty: the clip as a whole."""
    figure: float | None = None

    @classmethod
    def of(cls, code: Code, frames: np.ndarray | None = None, figure: float | None = None, **words: Any) -> Finding:
        """frames: (T,) bool, those concerned; figure: how much or how many; words: what else the sentence names."""
        named = {} if frames is None else {"frames": name_frames(frames)}
        wording = code.value
        message = wording.sentence.format(**named, figure=figure, **words)
        return cls(code, f"{message} {wording.advice}" if wording.advice else message,
                   [] if frames is None else runs_of_frames(frames), None if figure is None else float(figure))

    def to_json(self) -> dict[str, Any]:
        """As records and `--json` have it, beside the message."""
        return {"code": self.code.word, "severity": self.code.value.severity.value, "frames": self.frames, "figure": self.figure}


def runs_of_frames(mask: np.ndarray) -> list[list[int]]:
    """[first, last] of every run of True in mask, (T,) bool."""
    index = np.flatnonzero(mask)
    return [[int(run[0]), int(run[-1])] for run in np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if len(run)]
