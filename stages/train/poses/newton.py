"""Newton steps of one frame's pose in the steps of a training: the frame's last inverse Hessian takes its gradient to a step.

The loss bends more than the Hessian tells, by as much as SSIM has in it, and ever more as the error falls. So a frame's share of a
step is halved when its gradient turns back, as it does beyond the minimum and in noise, and grows again while it does not (as in
Rprop; Riedmiller and Braun 1993).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SHARE = 0.15
"""Largest share of a whole step, which noise of single steps would follow."""
LESS, MORE = 0.5, 1.2
"""Factors on the share where the gradient has turned back, and where it has not."""
MOST = 0.02
"""rad and m, largest step."""


@dataclass
class NewtonSteps:
    """Of one frame."""

    inverse: np.ndarray
    """(U, U) float32: of the loss, by turns and transl as in `photometric.UNKNOWNS`."""
    share: float = SHARE
    last: np.ndarray | None = None
    """(U,) gradient of the step before; None before the first."""

    def step(self, gradient: np.ndarray) -> np.ndarray:
        """(U,) rad and m, to be added. gradient: (U,) of the loss."""
        whole = self.inverse @ gradient
        if self.last is not None:
            self.share = self.share * LESS if self.last @ whole < 0 else min(self.share * MORE, SHARE)
        self.last = gradient
        return np.clip(-self.share * whole, -MOST, MOST)
