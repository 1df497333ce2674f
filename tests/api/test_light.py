"""Lights: geometry, radiance, changes in place."""

from __future__ import annotations

import copy
import pickle
import threading
from typing import Any

import numpy as np
import pytest

import miplight as ml


@pytest.fixture
def tv() -> ml.AreaLight:
    return ml.AreaLight((-1, 3, -1), (2, 0, 0), (0, 0, 2), radiance=(12, 12, 12))


@pytest.fixture
def lamp() -> ml.SpotLight:
    return ml.SpotLight((0, 3, 0), (1, 0, 0), intensity=(50, 40, 30), cutoff=30)


def test_area_light_defaults_and_geometry(tv: ml.AreaLight) -> None:
    assert (tv.two_sided, tv.visible, tv.filter) == (False, True, "nearest")
    assert tv.normal.tolist() == [0.0, -1.0, 0.0]
    assert tv.area == pytest.approx(4.0)
    assert tv.bounds.tolist() == [[-1, 3, -1], [1, 3, 1]]
    assert not tv.is_textured
    assert tv.corner.dtype == np.float64
    assert "radiance=(12, 12, 12)" in repr(tv)
    assert "two_sided" not in repr(tv)


def test_normal_of_tiny_and_huge_lights() -> None:
    for scale in (1e-9, 1e9):
        light = ml.AreaLight((0, 0, 0), (scale, 0, 0), (0, scale, 0))
        np.testing.assert_allclose(light.normal, (0, 0, 1))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("corner", (np.nan, 0, 0)),
        ("corner", (0, 0)),
        ("edge_u", (0, 0, 0)),
        ("edge_u", (np.inf, 0, 0)),
        ("edge_v", (4, 0, 0)),
        ("edge_v", (-1, 0, 1e-9)),
        ("radiance", (-1.0, 0, 0)),
        ("radiance", (np.nan, 0, 0)),
        ("radiance", 5.0),
        ("radiance", np.full((4, 4, 3), 255, np.uint8)),
        ("radiance", np.ones((4, 4))),
        ("radiance", np.ones((4, 4, 4))),
        ("radiance", np.full((4, 4, 3), np.inf)),
        ("two_sided", 1),
        ("visible", "yes"),
        ("filter", "cubic"),
    ],
)
def test_bad_area_lights_leave_everything_as_it_was(tv: ml.AreaLight, name: str, value: Any) -> None:
    before = repr(tv)
    with pytest.raises(ml.SceneError, match=name):
        setattr(tv, name, value)
    assert repr(tv) == before
    arguments: dict[str, Any] = {"corner": (0, 0, 0), "edge_u": (1, 0, 0), "edge_v": (0, 1, 0)}
    with pytest.raises(ml.SceneError, match=name):
        ml.AreaLight(**{**arguments, name: value})


def test_area_light_changes(tv: ml.AreaLight) -> None:
    tv.corner, tv.edge_u, tv.edge_v = (0, 0, 0), [3, 0, 0], np.array([0, 2, 0], np.int8)
    assert tv.normal.tolist() == [0.0, 0.0, 1.0]
    tv.radiance = np.full((3, 5, 3), 0.5, np.float16)
    assert tv.is_textured
    assert tv.radiance.dtype == np.float32
    tv.two_sided, tv.visible, tv.filter = True, False, "linear"
    assert repr(tv).endswith("radiance=<3x5 image>, two_sided=True, visible=False, filter='linear')")
    with pytest.raises(AttributeError):
        tv.radience = (1.0, 1.0, 1.0)  # type: ignore[attr-defined]


def test_both_edges_at_once(tv: ml.AreaLight) -> None:
    # one after the other would pass through parallel edges
    with pytest.raises(ml.SceneError, match="parallel"):
        tv.edge_u = (0, 0, 5)
    tv.set_geometry(edge_u=(0, 0, 5), edge_v=(5, 0, 0))
    assert tv.normal.tolist() == [0.0, 1.0, 0.0]
    assert tv.corner.tolist() == [-1, 3, -1]


def test_an_image_is_uploaded_only_when_it_is_another_one(tv: ml.AreaLight) -> None:
    tv.radiance = np.ones((2, 2, 3))
    tv._core_light("tv")
    assert tv._texture is not None
    first = tv._texture[1]
    tv.corner = (0, 0, 0)
    tv._core_light("tv")
    assert tv._texture[1] is first
    tv.radiance = np.ones((2, 2, 3)) * 2
    tv._core_light("tv")
    assert tv._texture[1] is not first


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("position", (0, np.inf, 0)),
        ("target", (0, 3, 0)),
        ("intensity", (-1, 0, 0)),
        ("intensity", np.ones((2, 2, 3))),
        ("intensity", np.array([5, 5, 5])),
        ("cutoff", 0.0),
        ("cutoff", 80.5),
        ("cutoff", np.nan),
    ],
)
def test_bad_spot_lights_leave_everything_as_it_was(lamp: ml.SpotLight, name: str, value: Any) -> None:
    before = repr(lamp)
    with pytest.raises(ml.SceneError, match=name):
        setattr(lamp, name, value)
    assert repr(lamp) == before


def test_spot_light_changes(lamp: ml.SpotLight) -> None:
    lamp.cutoff = 80
    lamp.intensity = (1.0, 2.0, 3.0)
    lamp.set_geometry(position=(1, 0, 0), target=(1, 5, 0))
    assert lamp.direction.tolist() == [0.0, 1.0, 0.0]
    assert lamp.cutoff == 80.0
    lamp.position = (1, 0, 1)
    lamp.target = (1, 0, 0)
    assert lamp.direction.tolist() == [0.0, 0.0, -1.0]


def test_copies_and_pickles_are_independent(tv: ml.AreaLight, lamp: ml.SpotLight) -> None:
    tv.radiance = np.ones((2, 2, 3))
    tv._core_light("tv")
    for light in (tv, lamp):
        for again in (pickle.loads(pickle.dumps(light)), copy.deepcopy(light), light.copy()):
            assert repr(again) == repr(light)
    other = tv.copy()
    other.radiance = (5.0, 5.0, 5.0)
    assert tv.is_textured
    restored: ml.AreaLight = pickle.loads(pickle.dumps(tv))
    assert not restored.radiance.flags.writeable
    restored._core_light("tv")


def test_threads_lose_no_change(tv: ml.AreaLight) -> None:
    def flip(name: str, values: list[Any]) -> None:
        for k in range(400):
            setattr(tv, name, values[k % 2])

    jobs = {
        "radiance": [(1.0, 1.0, 1.0), (2.0, 2.0, 2.0)],
        "two_sided": [False, True],
        "corner": [(0, 0, 0), (9, 9, 9)],
    }
    threads = [threading.Thread(target=flip, args=job) for job in jobs.items()]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (tv.radiance.tolist(), tv.two_sided, tv.corner.tolist()) == ([2.0, 2.0, 2.0], True, [9, 9, 9])
