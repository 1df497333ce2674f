"""Mitsuba 3.9 as the reference renderer: the same scene, the same picture, with its noise known.

`to_dict` hands a scene to Mitsuba; `reference` renders it, keeps two independent halves, and remembers the
result. Mitsuba is an optional extra (``pip install "mitsuba>=3.9,<3.10"``) and is imported when first needed.
"""

from __future__ import annotations

from .cache import cache_folder
from .estimate import Part
from .export import Pixel, to_dict
from .reference import Reference, reference
from .variant import activate, pick_variant

__all__ = ["Part", "Pixel", "Reference", "activate", "cache_folder", "pick_variant", "reference", "to_dict"]
