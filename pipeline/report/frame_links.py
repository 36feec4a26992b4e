"""Links from a frame's number in a sentence to its picture on the page, or to the nearest one of the same section."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from markupsafe import Markup, escape

if TYPE_CHECKING:
    from gsac.pipeline.report.page import Section

NAMED = re.compile(r"\bframes? \(?(\d+(?:(?:-|, | to | and )\d+)*)")
"""A frame, or frames in a row, as stages name them."""
SECTION_OF = {"split": "clip", "keypoints": "keypoints", "handgap": "keypoints", "segment": "alpha", "face": "clip",
              "smplx": "body", "train": "heldout"}
"""Stage -> the section whose pictures show what its warnings are about."""


class FrameLinks:
    """What frames each section shows."""

    def __init__(self, sections: Sequence[Section]):
        self.shown = {section.ident: [p.frame for p in section.sheet.pictures if p.frame is not None]
                      for section in sections if section.sheet}

    def link(self, text: str, stage: str = "train") -> Markup:
        """A sentence of a stage as HTML; its frames' numbers are links where the section has pictures."""
        ident = SECTION_OF.get(stage, "clip")
        frames = self.shown.get(ident) or []
        if not frames:
            return escape(text)

        def anchor(number: re.Match) -> str:
            nearest = min(frames, key=lambda frame: abs(frame - int(number[0])))
            return f'<a href="#{ident}-{nearest}" title="picture of frame {nearest}">{number[0]}</a>'

        def anchors(named: re.Match) -> str:
            return named[0].removesuffix(named[1]) + re.sub(r"\d+", anchor, named[1])

        return Markup(NAMED.sub(anchors, str(escape(text))))
