"""What each published protocol fixes, and the rows that were published by it. Figures only, as their sources tell them."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Row:
    """One published row."""

    system: str
    psnr: float
    ssim: float | None
    lpips: float | None
    source: str


@dataclass(frozen=True)
class Protocol:
    """How held-out frames are scored."""

    data: str
    """Which data set, and whose frames."""
    height: int | None
    """px of the frames; None: as filmed."""
    black: bool
    """Whether the person stands on black; else on white. All of the frame counts."""
    aligned: bool
    """Whether test poses are moved onto the test images before they are scored."""
    batch: int | None
    """Images whose pixels are pooled in one PSNR before the mean of these; None: all of them."""
    lpips: str
    """Name of the LPIPS in metrics.json."""
    rows: dict[str, tuple[Row, ...]] = field(default_factory=dict)
    """Subject -> what was published."""

    def describe(self) -> str:
        """One line: all that a figure depends on."""
        pooling = {None: "one PSNR of all pixels", 1: "mean of the images' PSNR"}
        return ", ".join((
            self.data, f"{self.height} px" if self.height else "px as filmed",
            f"whole frame on {'black' if self.black else 'white'}",
            "test poses moved onto the test images" if self.aligned else "test poses fitted to key points and mask, not to colours",
            pooling.get(self.batch, f"mean PSNR of batches of {self.batch}"),
            f"LPIPS {self.lpips.removeprefix('lpips_').replace('_', ' ')}"))


GSAC = "GSAC's own table, mean of 5 runs"
FMGS = "FMGS-Avatar's table"


def _gsac(poses: tuple[float, float, float], raw: tuple[float, float, float],
          filled: tuple[float, float, float]) -> tuple[Row, ...]:
    return (Row("HAHA's poses", *poses, GSAC), Row("GSAC, no hand correction", *raw, GSAC), Row("GSAC", *filled, GSAC))


def _instant(psnr: float, ssim: float, lpips: float) -> tuple[Row, ...]:
    return (Row("InstantAvatar", psnr, ssim, lpips, FMGS),)


def _given(first: tuple[float, float, float], second: tuple[float, float, float]) -> tuple[Row, ...]:
    return (Row("3DGS-Avatar", *first, FMGS), Row("FMGS-Avatar", *second, FMGS))


SNAPSHOT, OWN = "PeopleSnapshot by InstantAvatar's split", "ExAvatar's own table"
PROTOCOLS = {
    "gsac": Protocol(SNAPSHOT, 1080, True, False, 4, "lpips_alex_black", {
        "male-3-casual": _gsac((30.686, 0.9612, 0.0433), (28.691, 0.9493, 0.0568), (29.702, 0.9543, 0.0552)),
        "male-4-casual": _gsac((26.580, 0.9600, 0.0488), (26.334, 0.9579, 0.0552), (26.848, 0.9606, 0.0544)),
        "female-3-casual": _gsac((28.347, 0.9558, 0.0593), (29.407, 0.9565, 0.0566), (29.985, 0.9580, 0.0560)),
        "female-4-casual": _gsac((29.074, 0.9529, 0.0440), (28.604, 0.9521, 0.0469), (28.950, 0.9533, 0.0465))}),
    "haha": Protocol(SNAPSHOT, 544, True, True, None, "lpips_alex_black", {
        "male-3-casual": (Row("HAHA", 31.46, None, None, "an answer of its authors, issue 11 of its repository"),)}),
    "instant-avatar": Protocol(SNAPSHOT, 540, False, True, 1, "lpips_alex_unscaled", {
        "male-3-casual": _instant(29.65, 0.9731, 0.0192), "male-4-casual": _instant(27.97, 0.9649, 0.0346),
        "female-3-casual": _instant(27.90, 0.9722, 0.0249), "female-4-casual": _instant(28.92, 0.9692, 0.0180)}),
    "3dgs-avatar": Protocol(SNAPSHOT, 540, True, False, 1, "lpips_alex_black", {
        "male-3-casual": _given((30.57, 0.9581, 0.0209), (30.92, 0.9816, 0.0152)),
        "male-4-casual": _given((33.16, 0.9678, 0.0157), (33.78, 0.9753, 0.0237)),
        "female-3-casual": _given((34.28, 0.9724, 0.0149), (33.89, 0.9854, 0.0142)),
        "female-4-casual": _given((30.22, 0.9653, 0.0231), (30.95, 0.9873, 0.0158))}),
    "exavatar-xhumans": Protocol("X-Humans, all takes", None, False, False, 1, "lpips_alex", {
        "00028": (Row("ExAvatar", 30.58, 0.981, 0.018, OWN),), "00034": (Row("ExAvatar", 28.75, 0.966, 0.029, OWN),),
        "00087": (Row("ExAvatar", 32.01, 0.972, 0.025, OWN),)}),
    "exavatar-neuman": Protocol("NeuMan, its own split", None, False, True, 1, "lpips_alex", {
        "mean": (Row("ExAvatar", 34.80, 0.984, 0.009, OWN),)}),
}
"""By the name that is typed."""
