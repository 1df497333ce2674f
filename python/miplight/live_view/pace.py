"""How small a picture has to be to come in time while something moves."""

from __future__ import annotations

SCALES = (1.0, 0.75, 0.5, 0.375, 0.25, 0.1875, 0.125)
"""Widths and heights of moving pictures, as fractions of the full ones."""

# A larger picture is expected to take longer by its width: more than where all cost is fixed, less than where
# it goes with the pixels. It is tried when that is in time, after so many frames in a row that said so.
_PATIENCE = 3
# A size that came too late among its first frames is avoided for so many, and each time for twice as many.
_TRIAL, _AVOID = 6, 30
# A smaller picture aims at this much of the time that there is.
_ROOM = 0.8
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
        self._frames = self._changed = 0
        self._before: float | None = None  # what the last frame of the same size took
        self._avoid: dict[int, tuple[int, int]] = {}  # step: until which frame, for how many the last time
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
        self._avoid.clear()

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
        if scale != self.scale:
            return  # a still one, after something has been learned from moving ones
        self._frames += 1
        far = ms > _FAR_TOO_LONG * self.budget_ms
        # the first frame of a size makes its buffers, and any single one may have been held up
        first, usual = self._before is None, min(ms, self._before or ms)
        self._before = ms
        if far and can_be_lean and not self.lean:
            self.lean = True
            self._before, self._quick = None, 0
        elif far or (usual > self.budget_ms and not first):
            self._smaller(ms, scale)
        elif first:
            return
        elif self._step > 0:
            expected = ms * SCALES[self._step - 1] / scale
            free = self._avoid.get(self._step - 1, (0, 0))[0] <= self._frames
            self._quick = self._quick + 1 if expected < self.budget_ms and free else 0
            if self._quick >= _PATIENCE:
                self._go(self._step - 1)

    def _smaller(self, ms: float, scale: float) -> None:
        """Leave a size that took too long."""
        if self._frames - self._changed <= _TRIAL:
            _, last = self._avoid.get(self._step, (0, _AVOID // 2))
            self._avoid[self._step] = (self._frames + 2 * last, 2 * last)
        # time goes with the pixels, at most: what does not is found at the next frame
        wanted = scale * (_ROOM * self.budget_ms / ms) ** 0.5
        small = [step for step, size in enumerate(SCALES) if size <= wanted]
        self._go(max(self._step, small[0] if small else len(SCALES) - 1))

    def _go(self, step: int) -> None:
        if step != self._step:
            self._step, self._changed, self._before = step, self._frames, None
        self._quick = 0
