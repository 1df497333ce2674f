"""Memory layout of what shaders read and write; `tests/rust/layouts.rs` proves it of the host's structs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

MISS = 0xFFFFFFFF
NOTHING, SURFACE, FIRST_LIGHT = 0, 1, 2
SMOOTH, COLORS, TEXTURE, LIGHT = 1, 2, 4, 8


def _fields(*names: str) -> list[tuple[str, str]]:
    return [(name, "<u4") for name in names]


RAY = np.dtype([("origin", "<f4", 3), ("t_min", "<f4"), ("direction", "<f4", 3), ("t_max", "<f4")])
HIT = np.dtype([("t", "<f4"), ("u", "<f4"), ("v", "<f4"), ("instance", "<u4"), ("triangle", "<u4")])
RECEIVER = np.dtype(
    [
        ("origin", "<f4", 3),
        ("pattern", "<u4"),
        ("normal_geo", "<f4", 3),
        ("flags", "<u4"),
        ("normal_shade", "<f4", 3),
        ("pixel", "<u4"),
    ]
)
VIEW = np.dtype(
    [
        ("eye", "<f4", 3),
        ("width", "<u4"),
        ("right", "<f4", 3),
        ("height", "<u4"),
        ("up", "<f4", 3),
        ("fx", "<f4"),
        ("backward", "<f4", 3),
        ("fy", "<f4"),
        ("cx", "<f4"),
        ("cy", "<f4"),
        ("first", "<u4"),
        ("tiled", "<u4"),
    ]
)
INSTANCE = np.dtype(
    [
        ("scene_from_object", "<f4", (3, 4)),
        ("object_from_scene", "<f4", (3, 4)),
        ("albedo", "<f4", 3),
        *_fields("flags", "triangles", "positions", "normals", "uvs", "colors"),
        *_fields("texture", "texture_width", "texture_height", "light"),
        ("extent", "<f4"),
        *_fields("pad0", "pad1"),
    ]
)
GATHER_PATH = np.dtype(
    [
        ("throughput", "<f4", 3),
        ("pixel", "<u4"),
        ("pending", "<f4", 3),
        ("stratum", "<u4"),
        ("slope", "<f4", 3),
        ("pad", "<u4"),
    ]
)
GATHER_WAVE = np.dtype(
    _fields("width", "height", "first_tile", "tiles", "first_stratum", "strata", "strata_u", "strata_v")
    + _fields("lights", "seed", "bounce", "last")
)
LIGHT_SAMPLES = np.dtype(
    [
        *_fields("light", "strata_u", "strata_v", "patterns", "seed", "jittered"),
        ("t_max", "<f4"),
        ("classes", "<u4"),
    ]
)
RECEIVERS = np.dtype(_fields("width", "height", "first", "patterns", "seed", "pad0", "pad1", "pad2"))
GATHER = np.dtype(_fields("strata", "words", "light", "pad"))
IRRADIANCE = np.dtype(
    [
        ("corner", "<f4", 3),
        ("width", "<u4"),
        ("axis_x", "<f4", 3),
        ("height", "<u4"),
        ("axis_y", "<f4", 3),
        ("two_sided", "<u4"),
        ("axis_z", "<f4", 3),
        ("tiles", "<u4"),
        ("radiance", "<f4", 3),
        ("textured", "<u4"),
        ("edge", "<f4", 4),
        ("along_v", "<f4", 2),
        ("size", "<f4"),
        ("cos_cutoff", "<f4"),
        *_fields("kind", "first_node", "nodes", "pad"),
    ]
)
LIGHT_NODE = np.dtype([("place", "<f4", 2), ("pad", "<f4", 2), ("moment", "<f4", 4)])
MOMENTS = np.dtype([("mean", "<f4", 3), ("cell_area", "<f4"), *_fields("fine", "coarse", "pad0", "pad1")])
NODE = np.dtype([("lo", "<f4", 3), ("first", "<u4"), ("hi", "<f4", 3), ("count", "<u4")])
TRIANGLE = np.dtype(
    [("a", "<f4", 3), ("id", "<u4"), ("b", "<f4", 3), ("pad_b", "<u4"), ("c", "<f4", 3), ("pad_c", "<u4")]
)
PLACED = np.dtype(
    [
        ("row_x", "<f4", 3),
        ("node", "<u4"),
        ("row_y", "<f4", 3),
        ("triangle", "<u4"),
        ("row_z", "<f4", 3),
        ("id", "<u4"),
        ("center", "<f4", 3),
        ("reach", "<f4"),
    ]
)
SHADOW = np.dtype(
    [
        ("light_normal", "<f4", 3),
        ("two_sided", "<u4"),
        ("cone_axis", "<f4", 3),
        ("cos_cutoff", "<f4"),
        *_fields("receivers", "strata", "patterns", "words"),
    ]
)
VOXELS = np.dtype(
    [
        ("eye", "<f4", 3),
        ("columns", "<u4"),
        ("right", "<f4", 3),
        ("rows", "<u4"),
        ("up", "<f4", 3),
        ("words", "<u4"),
        ("backward", "<f4", 3),
        ("near", "<f4"),
        ("scale", "<f4", 2),
        ("center", "<f4", 2),
        ("far", "<f4"),
        ("slices_per_depth", "<f4"),
        ("bias", "<f4"),
        ("steps", "<u4"),
    ]
)
VOXELIZE = np.dtype(_fields("first", "triangles", "instances", "blocks"))
MAP = np.dtype(
    [
        ("normal", "<f4", 3),
        *_fields("resolution", "sides", "first", "samples"),
        ("offset", "<f4"),
        ("tan_half", "<f4"),
        *_fields("pad0", "pad1", "pad2"),
    ]
)
PROVE = np.dtype(_fields("width", "height", "pad0", "pad1"))
LIGHT_FRAME = np.dtype(
    [
        ("corner", "<f4", 3),
        ("extent_a", "<f4"),
        ("dual_u", "<f4", 3),
        ("extent_b", "<f4"),
        ("dual_v", "<f4", 3),
        ("two_sided", "<u4"),
        ("normal", "<f4", 3),
        ("cos_cutoff", "<f4"),
    ]
)
TILE_BOUNDS = np.dtype([("lo", "<f4", 3), ("facing", "<u4"), ("hi", "<f4", 3), ("pad", "<u4")])
COMPOSITE = np.dtype(_fields("direct", "indirect", "pad0", "pad1"))
CUT = np.dtype(
    [
        *_fields("roots", "coarsest", "finest", "maps", "bound"),
        ("threshold", "<f4"),
        ("reach", "<f4"),
        *_fields("rays", "seed", "maps_size", "reference", "first_root", "part", "parts", "pad0", "pad1"),
    ]
)
SHADED_POINT = np.dtype(
    [
        ("origin", "<f4", 3),
        ("exponent", "<f4"),
        ("normal_shade", "<f4", 3),
        ("red", "<f4"),
        ("normal_geo", "<f4", 3),
        ("green", "<f4"),
        ("mirror", "<f4", 3),
        ("blue", "<f4"),
    ]
)
VPL_POINTS = np.dtype(
    [
        ("lights", "<u4"),
        ("reach", "<f4"),
        ("threshold", "<f4"),
        *_fields("first", "end", "pad0", "pad1", "pad2"),
    ]
)
VPL_GATHER = np.dtype(
    [*_fields("first", "end"), ("reach", "<f4"), *_fields("part", "parts", "pad0", "pad1", "pad2")]
)
VPL_LISTS = np.dtype(
    [
        *_fields("first", "count", "words", "lowest"),
        ("reach", "<f4"),
        *_fields("pad0", "pad1", "pad2"),
    ]
)
FRAGMENT_RECEIVERS = np.dtype(_fields("first", "patterns", "seed", "pad"))
PYRAMID = np.dtype(
    [("levels", "<u4", (17, 4)), *_fields("coarsest", "finest", "level"), ("pixel_width", "<f4")]
)
ONE_PASS = np.dtype(
    [
        ("depth_threshold", "<f4"),
        ("normal_threshold", "<f4"),
        *_fields("lights", "pad"),
    ]
)
COMPACT = np.dtype(_fields("items", "mask", "value", "scanned"))
LIGHT_FRAME = np.dtype(
    [
        ("corner", "<f4", 3),
        ("extent_a", "<f4"),
        ("dual_u", "<f4", 3),
        ("extent_b", "<f4"),
        ("dual_v", "<f4", 3),
        ("two_sided", "<u4"),
        ("normal", "<f4", 3),
        ("cos_cutoff", "<f4"),
    ]
)
TILE_BOUNDS = np.dtype([("lo", "<f4", 3), ("facing", "<u4"), ("hi", "<f4", 3), ("pad", "<u4")])
LIGHT_BOUNDS = np.dtype(_fields("width", "height", "light", "unshadowed"))
LIST = np.dtype(
    _fields("width", "height", "light", "patterns", "seed", "first", "blocks_u", "reuse", "boosts")
    + _fields("pad0", "pad1", "pad2")
)
PENUMBRA = np.dtype(
    [
        *_fields("width", "height", "first", "most_subs"),
        *((name, "<f4") for name in ("light_size", "untraced", "one", "four", "narrow", "wide", "calm")),
        *_fields("pad"),
    ]
)
UNIFORM_LEVELS = np.dtype(
    _fields("width", "height", "slot", "coarsest", "own_pixels", "again", "last", "pad")
)
NODES = np.dtype(_fields("base", "parents", "patterns", "classes", "seed", "inherit", "pad1", "pad2"))
REUSE = np.dtype(
    [
        ("light_normal", "<f4", 3),
        ("two_sided", "<u4"),
        ("cone_axis", "<f4", 3),
        ("cos_cutoff", "<f4"),
        *_fields("first", "strata", "words", "reuse"),
        ("corner", "<f4", 3),
        *_fields("classes"),
        ("edge_u", "<f4", 3),
        *_fields("together"),
        ("edge_v", "<f4", 3),
        *_fields("above"),
    ]
)
SUB_FRAGMENTS = np.dtype(
    _fields("first", "classes", "together", "words", "least_bits", "most_apart", "counts", "hard")
)
STOP_GUARD = np.dtype(_fields("first", "hard", "pad1", "pad2"))
EXTRA_SAMPLES = np.dtype(_fields("patterns", "seed", "pad0", "pad1"))
INTERLEAVED = np.dtype(
    [
        *_fields("first", "strata", "words", "classes"),
        ("normal", "<f4", 3),
        ("cos_cutoff", "<f4"),
        ("corner", "<f4", 3),
        ("two_sided", "<u4"),
        ("step_u", "<f4", 3),
        ("row", "<u4"),
        ("step_v", "<f4", 3),
        ("pad", "<u4"),
    ]
)
INCREMENTAL = np.dtype(
    [
        *_fields("first", "count", "words", "least_bits"),
        ("threshold", "<f4"),
        *_fields("pad0", "pad1", "pad2"),
    ]
)
RSM_MAP = np.dtype(
    [
        ("origin", "<f4", 3),
        ("kind", "<u4"),
        ("axis", "<f4", 3),
        ("tan_half", "<f4"),
        ("edge_u", "<f4", 3),
        ("cos_cutoff", "<f4"),
        ("edge_v", "<f4", 3),
        ("offset", "<f4"),
        *_fields("tiles", "resolution"),
        ("equal", "<f4"),
        *_fields("map"),
    ]
)
VIRTUAL_LIGHT = np.dtype(
    [
        ("position", "<f4", 3),
        ("area", "<f4"),
        ("normal", "<f4", 3),
        ("radius", "<f4"),
        ("flux", "<f4", 3),
        ("solid_angle", "<f4"),
        ("spread", "<f4"),
        ("thickness", "<f4"),
        *_fields("block", "extent"),
    ]
)
RSM = np.dtype(_fields("first", "stride", "pad0", "pad1"))
RSM_TREE = np.dtype(_fields("level", "finest", "maps", "single"))
VPL_CLUSTERS = np.dtype(
    [
        *_fields("first", "maps", "first_spot", "by_range"),
        *_fields("coarsest_area", "finest_area", "coarsest_spot", "finest_spot"),
        ("depth_threshold", "<f4"),
        ("normal_threshold", "<f4"),
        *_fields("pad0", "pad1"),
    ]
)
VPL_IMPORTANCE = np.dtype(_fields("count", "maps", "finest", "seed"))
VPL_GRID = np.dtype(_fields("resolution", "across", "first_map", "first_light"))
DOWNSAMPLE = np.dtype(_fields("width", "height", "factor", "pad"))


def record(dtype: np.dtype[Any], **values: Any) -> NDArray[Any]:
    """One struct with these fields, zeros elsewhere."""
    made = np.zeros(1, dtype)
    for name, value in values.items():
        made[name] = value
    return made


def row(xyz: NDArray[Any], w: Any) -> NDArray[np.uint32]:
    """Rows of the G-buffer: three floats as their bits, and a word; (n, 4) from (n, 3) and (n,)."""
    words = np.empty((len(xyz), 4), np.uint32)
    words[:, :3] = np.ascontiguousarray(xyz, np.float32).view(np.uint32)
    words[:, 3] = w
    return words


def floats(rows: NDArray[np.uint32]) -> NDArray[np.float32]:
    """The three floats of each row."""
    return np.ascontiguousarray(rows[..., :3]).view(np.float32)


def bits(number: Any) -> NDArray[np.uint32]:
    """The bits of float32 numbers."""
    return np.atleast_1d(np.asarray(number, np.float32)).view(np.uint32)
