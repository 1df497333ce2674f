"""How small a picture has to be to come in time while something moves."""

from __future__ import annotations

SCALES = (1.0, 0.75, 0.5, 0.375, 0.25, 0.1875, 0.125)
"""Widths and heights of moving pictures, as fractions of the full ones."""

# A larger picture is tried when it is expected to take less than this much of the time that there is,
_ROOM = 0.8
# after so many frames in a row that said so: one quick frame may be luck.
_PATIENCE = 3
# Indirect light is left out where a frame takes this many times too long: no size would help.
_FAR_TOO_LONG = 2.0


class Pace:
    """The size of moving pictures, from what the last ones took.

    Parameters
    ----------
    budget_ms
        Milliseconds that a frame should take at most.
    """

    def __init__(self, budget_ms: float) -> None:
        self.budget_ms = budget_ms
        self._step = 0
        self._quick = 0
        self.lean = False
        """Whether indirect light is left out while something moves."""

    @property
    def scale(self) -> float:
        """Width and height of the next moving picture, as a fraction of the full ones."""
        return SCALES[self._step]

    @property
    def at_the_end(self) -> bool:
        """Whether nothing smaller is left to try."""
        return self._step == len(SCALES) - 1

    def forget(self) -> None:
        """Other settings: what the last frames took says nothing about lean ones any more."""
        self.lean = False
        self._quick = 0

    def took(self, ms: float, scale: float, *, can_be_lean: bool = False) -> None:
        """Learn from a frame.

        Parameters
        ----------
        ms
            Milliseconds from its start to its end.
        scale
            Its width and height, as a fraction of the full ones.
        can_be_lean
            Whether it had indirect light, which may be left out.
        """
        if ms > _FAR_TOO_LONG * self.budget_ms and can_be_lean and not self.lean:
            self.lean = True
            self._quick = 0
            return
        if ms > self.budget_ms:
            # time goes with the pixels, at most: what does not is found at the next frame
            wanted = scale * (_ROOM * self.budget_ms / ms) ** 0.5
            small = [step for step, size in enumerate(SCALES) if size <= wanted]
            self._step = max(self._step, small[0] if small else len(SCALES) - 1)
            self._quick = 0
            return
        if self._step == 0 or scale != self.scale:
            return
        expected = ms * (SCALES[self._step - 1] / scale) ** 2
        self._quick = self._quick + 1 if expected < _ROOM * self.budget_ms else 0
        if self._quick >= _PATIENCE:
            self._step -= 1
            self._quick = 0
