"""Links from a frame's number in a sentence to its picture on the page, or to the nearest one of the same section."""

from __future__ import annotations

import re
from collections.abc import Mapping

from markupsafe import Markup, escape

NAMED = re.compile(r"\bframes? \(?(\d+(?:(?:-|, | to | and )\d+)*)")
"""A frame, or frames in a row, as stages name them."""
SECTION_OF = {"split": "clip", "keypoints": "keypoints", "handgap": "keypoints", "segment": "alpha", "face": "clip",
              "smplx": "body", "train": "heldout"}
"""Stage -> the section whose pictures show what its warnings are about."""


class FrameLinks:
    """Makes links to the frames that the sections show."""

    def __init__(self, shown: Mapping[str, list[int]]):
        """shown: section -> the frames that it has pictures of."""
        self.shown = shown

    def link(self, text: str, stage: str = "train") -> Markup:
        """A sentence of a stage as HTML; its frames' numbers are links where the section has pictures."""
        ident = SECTION_OF.get(stage, "clip")
        frames = self.shown.get(ident, [])
        if not frames:
            return escape(text)

        def anchor(number: re.Match) -> str:
            nearest = min(frames, key=lambda frame: abs(frame - int(number[0])))
            return f'<a href="#{ident}-{nearest}" title="picture of frame {nearest}">{number[0]}</a>'

        def anchors(named: re.Match) -> str:
            return named[0].removesuffix(named[1]) + re.sub(r"\d+", anchor, named[1])

        return Markup(NAMED.sub(anchors, str(escape(text))))
