"""Tells a picture that bears a video's name, by its first bytes: to ffmpeg it is invalid data, or one tile of a HEIC photo."""

from __future__ import annotations

from pathlib import Path

from gsac.stages.contract import BadInput

STARTS = {b"\xff\xd8\xff": "jpg", b"\x89PNG\r\n": "png", b"BM": "bmp", b"II*\0": "tif", b"MM\0*": "tif"}
"""First bytes -> the ending that the file should have."""
WEBP, BRAND = b"WEBP", slice(8, 12)
"""What stands at `BRAND` of a file whose first bytes are RIFF's."""
HEIC = (b"heic", b"heix", b"heim", b"heis", b"mif1")
"""Brands of stills in the box `ftyp`; videos have others."""


def refuse_picture(path: Path) -> None:
    """Raises BadInput where the file is a picture."""
    with path.open("rb") as file:
        start = file.read(12)
    ending = next((ending for first, ending in STARTS.items() if start.startswith(first)), "")
    if start[:4] == b"RIFF" and start[BRAND] == WEBP:
        ending = "webp"
    if start[4:8] == b"ftyp" and start[BRAND] in HEIC:
        ending = "heic"
    if ending:
        raise BadInput(f"{path.name}: is a picture ({ending.upper()}) under a video's name. Give the video itself, or a folder of "
                       f"photos from all sides; if you mean this one photo, name it {path.stem}.{ending}.")
