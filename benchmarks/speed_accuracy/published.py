"""Published points of other systems: what they say of themselves, on their own clips, by their own protocol.

Seconds are of training alone, on the GPU that the authors used: fitting the body, 20 minutes and more where told, comes before.
PSNR is of the whole frame, of which most is plain background: a person on a tenth of the frame gains 10 dB against `psnr_fg`.
"""

from __future__ import annotations

from dataclasses import dataclass

SNAPSHOT = "PeopleSnapshot, mean of 4, whole white frame of 540 px"
MOVED = "poses moved onto the test images"


@dataclass(frozen=True)
class Published:
    """One point."""

    system: str
    seconds: float
    psnr: float
    protocol: str
    source: str


POINTS = (
    Published("GSAC", 709, 28.87, f"{SNAPSHOT}, {MOVED}", "GSAC's own table, mean of 5 runs"),
    Published("HAHA", 940, 28.67, f"{SNAPSHOT}, {MOVED}", "its poses and first stage, in GSAC's table"),
    Published("InstantAvatar", 60, 28.61, f"{SNAPSHOT}, {MOVED}", "FMGS-Avatar's and GoMAvatar's tables"),
    Published("GoMAvatar", 54000, 30.68, f"{SNAPSHOT}, {MOVED}", "its own table; time by FMGS-Avatar"),
    Published("GaussianAvatar", 4680, 30.98, SNAPSHOT, "third-party summary; time by GUAVA"),
    Published("3DGS-Avatar", 1020, 32.06, f"{SNAPSHOT}, poses given", "FMGS-Avatar's table, 17 to 30 minutes"),
    Published("FMGS-Avatar", 600, 32.39, f"{SNAPSHOT}, poses given", "its own table"),
    Published("ExAvatar", 5400, 34.80, f"NeuMan, person on white, {MOVED}", "its own table, 1.5 to 5 hours"),
    Published("JOintGS", 1380, 24.58, "NeuMan, tight boxes about the person", "its own table, 23 to 25 minutes"),
)
