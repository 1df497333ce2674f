"""References: their two halves, their variance, their parts, their cache."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import miplight as ml
from miplight.mitsuba import Reference, variant
from miplight.mitsuba import reference as make
from tests.mitsuba.closed_forms import floor_under, view_down

pytestmark = pytest.mark.mitsuba


@pytest.fixture
def corner() -> ml.Scene:
    """A floor and a wall under a light, with indirect light between them; the light is in view."""
    scene = ml.Scene()
    floor_under(scene, (0.8, 0.7, 0.6), size=6.0)
    wall = [(-3, 0, -1), (3, 0, -1), (3, 4, -1), (-3, 4, -1)]
    scene.add_arrays(wall, [(0, 1, 2), (0, 2, 3)], material=ml.Material((0.3, 0.7, 0.4)), shading="flat")
    scene.add_light(
        ml.AreaLight((-0.5, 3.0, 0.2), (1, 0, 0), (0, 0, 1), radiance=(9.0, 8.0, 7.0)), name="lamp"
    )
    return scene


@pytest.fixture
def view() -> ml.Camera:
    return ml.Camera.look_at((0.5, 1.8, 6), (0, 1.4, 0), fov_y=50, width=24, height=20)


def z_scores(first: Reference, second: Reference) -> Any:
    """Differences over their standard deviation, where there is any light."""
    spread = np.sqrt(first.variance + second.variance)
    lit = spread > 1e-6 * first.mean.mean()
    return ((first.mean - second.mean)[lit] / spread[lit]).ravel()


def test_what_it_is(corner: ml.Scene, view: ml.Camera) -> None:
    result = make(corner, view, 100, cached=False)
    assert result.mean.shape == result.variance.shape == (20, 24, 3)
    assert result.halves.shape == (2, 20, 24, 3)
    assert {result.mean.dtype, result.halves.dtype, result.variance.dtype} == {np.dtype(np.float32)}
    assert result.spp >= 100
    assert result.spp == 4 * result.info["passes"]
    np.testing.assert_allclose(result.halves.mean(axis=0), result.mean, rtol=1e-5)
    assert result.info["mitsuba"].startswith("3.9")
    assert 0.001 < result.relative_noise < 0.5
    assert "24x20" in repr(result)


def test_same_seed_same_bits_other_seed_other_noise(corner: ml.Scene, view: ml.Camera) -> None:
    first, again = (make(corner, view, 64, cached=False) for _ in range(2))
    np.testing.assert_array_equal(first.mean, again.mean)
    np.testing.assert_array_equal(first.halves, again.halves)
    other = make(corner, view, 64, seed=1, cached=False)
    assert not np.array_equal(first.mean, other.mean)
    assert not np.array_equal(first.halves[0], first.halves[1])


def test_variance_tells_the_noise(corner: ml.Scene, view: ml.Camera) -> None:
    rough, fine = (make(corner, view, n, seed=n, cached=False) for n in (256, 16384))
    z = z_scores(rough, fine)
    assert abs(z.mean()) < 0.15
    assert 0.8 < z.std() < 1.25
    halves = (rough.halves[0] - rough.halves[1])[rough.mean > 0] / 2
    assert 0.85 < np.sqrt(np.mean(halves**2)) / np.sqrt(rough.variance[rough.mean > 0].mean()) < 1.15
    # negative control: a picture 2 % brighter is told apart
    brighter = Reference(1.02 * fine.mean, 1.02 * fine.halves, fine.variance, fine.spp)
    assert abs(z_scores(rough, brighter).mean()) > 0.3


def test_halves_give_the_error_without_the_noise(corner: ml.Scene, view: ml.Camera) -> None:
    noisy = make(corner, view, 64, sampler="independent", cached=False)
    truth = make(corner, view, 16384, seed=5, cached=False).mean
    plain = ml.metrics.relative_rmse(truth, noisy.mean)
    assert plain > 0.01
    assert ml.metrics.relative_rmse(truth, noisy) < 0.6 * plain
    assert ml.metrics.relative_rmse(truth, noisy, noise_free=False) == pytest.approx(plain)
    # negative control: a true error of 5 % stays
    assert ml.metrics.relative_rmse(1.05 * truth, noisy) > 0.045


@pytest.mark.parametrize("sampler", ["independent", "multijitter"])
def test_parts_add_up(corner: ml.Scene, view: ml.Camera, sampler: str) -> None:
    options: dict[str, Any] = {"cached": False, "sampler": sampler}
    total = make(corner, view, 4096, 3, **options)
    direct, indirect = (make(corner, view, 4096, 3, p, seed=7, **options) for p in ("direct", "indirect"))
    light = total.mean.max(axis=-1) > 6.5
    assert 3 < light.sum() < 40
    assert direct.mean[light].max() == indirect.mean[light].max() == 0.0
    np.testing.assert_allclose(
        total.mean[light], np.broadcast_to((9.0, 8.0, 7.0), (light.sum(), 3)), rtol=1e-5
    )
    # the parts of the surfaces: 0.3 % of the mean is about their noise
    rest, parts = total.mean[~light], direct.mean[~light] + indirect.mean[~light]
    assert np.sqrt(np.mean((rest - parts) ** 2)) < 0.01 * rest.mean()
    assert abs(rest.mean() - parts.mean()) < 0.002 * rest.mean()
    # negative control: without the bounce a good part is missing
    assert rest.mean() - direct.mean[~light].mean() > 0.05 * rest.mean()


def test_max_depth_adds_bounces(corner: ml.Scene, view: ml.Camera) -> None:
    levels = [
        make(corner, view, 1024, depth, "direct" if depth == 2 else "total", cached=False)
        for depth in (2, 3, 4)
    ]
    bounces = [make(corner, view, 1024, depth, "indirect", cached=False).mean.mean() for depth in (3, 4)]
    assert 0 < bounces[0] < bounces[1] < 2 * bounces[0]
    assert levels[1].mean.mean() < levels[2].mean.mean()


def test_scalar_variant_agrees(corner: ml.Scene) -> None:
    view = ml.Camera.look_at((0.5, 1.8, 6), (0, 1.4, 0), fov_y=50, width=6, height=5)
    corner.add_light(ml.AreaLight((1.5, 1, 1), (0.5, 0, 0), (0, 0.5, 0), visible=False), name="hidden")
    for depth, part in ((2, "total"), (2, "direct"), (3, "total"), (3, "indirect")):
        scalar = make(corner, view, 64, depth, part, variant="scalar_rgb", cached=False)  # type: ignore[arg-type]
        fast = make(corner, view, 4096, depth, part, cached=False)  # type: ignore[arg-type]
        assert scalar.mean.mean() == pytest.approx(fast.mean.mean(), rel=0.05), (depth, part)
        assert np.abs(z_scores(scalar, fast)).mean() < 2.0


def test_the_callers_variant_comes_back(corner: ml.Scene, view: ml.Camera) -> None:
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    make(corner, view, 4, cached=False)
    assert mitsuba.variant() == "scalar_rgb"


def test_far_from_the_origin(corner: ml.Scene, view: ml.Camera) -> None:
    near = make(corner, view, 64, cached=False)
    offset = np.array((1e6, -2e6, 5e5))
    shift = np.eye(4)
    shift[:3, 3] = offset
    for name in list(corner.meshes):
        corner.set_transform(name, shift)
    lamp = corner.lights["lamp"]
    assert isinstance(lamp, ml.AreaLight)
    lamp.corner = lamp.corner + offset
    pose = shift @ view.world_from_camera
    far = make(corner, view.replace(world_from_camera=pose), 64, cached=False)
    assert ml.metrics.relative_rmse(far.mean, near.mean, trim=0.001) < 1e-4


# -- the cache


def test_a_second_call_reads_the_first(
    corner: ml.Scene, view: ml.Camera, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MIPLIGHT_CACHE", str(tmp_path))
    first = make(corner, view, 16)
    (file,) = tmp_path.rglob("*.npz")
    import sys

    from miplight.mitsuba import reference as module_function  # the function; its module is found by name

    module = sys.modules[module_function.__module__]
    monkeypatch.setattr(module, "_compute", lambda *_: pytest.fail("rendered again"))
    again = make(corner.copy(), view, 16)
    np.testing.assert_array_equal(first.mean, again.mean)
    assert again.info == first.info
    with pytest.raises(pytest.fail.Exception):  # negative control
        make(corner, view, 16, seed=1)
    monkeypatch.undo()
    monkeypatch.setenv("MIPLIGHT_CACHE", str(tmp_path))
    file.write_bytes(file.read_bytes()[:100])  # cut short: rendered again, and mended
    np.testing.assert_array_equal(make(corner, view, 16).mean, first.mean)
    assert file.stat().st_size > 100


def test_the_key_knows_all_that_matters(corner: ml.Scene, view: ml.Camera) -> None:
    from miplight.mitsuba.cache import content_key

    def changed(change: Any) -> str:
        scene = corner.copy()
        return content_key(scene, change(scene) or view, spp=1)

    lamp = "lamp"
    up = np.diag([1, 1, 1, 1.0])
    up[1, 3] = 1e-9
    keys = [
        changed(lambda _: None),
        changed(lambda s: s.set_transform("floor", up)),
        changed(lambda s: s.set_material("floor", ml.Material((0.8, 0.7, 0.6001)))),
        changed(lambda s: s.remove("floor")),
        changed(lambda s: s.set_vertices("floor", s.meshes["floor"].positions + 1e-9)),
        changed(lambda s: setattr(s.lights[lamp], "radiance", (9.0, 8.0, 7.1))),
        changed(lambda s: setattr(s.lights[lamp], "two_sided", True)),
        changed(lambda s: setattr(s.lights[lamp], "visible", False)),
        changed(lambda s: setattr(s.lights[lamp], "filter", "linear")),
        changed(lambda s: setattr(s.lights[lamp], "corner", (-0.5, 3.0, 0.2000001))),
        changed(lambda s: s.add_light(ml.SpotLight((0, 1, 0), (0, 0, 0))) and None),
        changed(lambda s: s.add_light(ml.SpotLight((0, 1, 0), (0, 0, 0), cutoff=44.0)) and None),
        changed(lambda _: view.replace(width=25)),
        changed(lambda _: view.replace(fov_y=50.001)),
        changed(lambda _: view_down()),
        content_key(corner, view, spp=2),
    ]
    assert len(set(keys)) == len(keys)
    assert changed(lambda _: None) == keys[0]


def test_the_cache_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MIPLIGHT_CACHE", str(tmp_path))
    assert ml.mitsuba.cache_folder() == tmp_path
    monkeypatch.delenv("MIPLIGHT_CACHE")
    assert ml.mitsuba.cache_folder().parts[-1] in ("miplight", "Cache")


def test_a_folder_that_cannot_be_written_costs_only_time(
    corner: ml.Scene, view: ml.Camera, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("MIPLIGHT_CACHE", str(tmp_path / "file"))
    assert make(corner, view, 4).mean.max() > 0


# -- files


@pytest.mark.parametrize("half", [False, True])
def test_save_and_load(corner: ml.Scene, view: ml.Camera, tmp_path: Path, half: bool) -> None:
    result = make(corner, view, 64, cached=False)
    result.save(tmp_path / "r.npz", half=half)
    back = Reference.load(tmp_path / "r.npz")
    tolerance = 1e-3 if half else 1e-6
    np.testing.assert_allclose(back.mean, result.mean, rtol=tolerance, atol=1e-6)
    np.testing.assert_allclose(back.halves, result.halves, rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(back.variance, result.variance, rtol=3 * tolerance, atol=1e-7)
    assert (back.spp, back.info) == (result.spp, result.info)


def test_broken_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "r.npz").write_bytes(b"PK\x03\x04")
    for name in ("r.npz", "none.npz"):
        with pytest.raises(ml.SceneError, match="allowed: a reference written by save"):
            Reference.load(tmp_path / name)


# -- refusals


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"spp": 0}, r"spp is 0; allowed: a whole number, 1 or more"),
        ({"spp": 4, "max_depth": 1}, r"max_depth is 1"),
        ({"spp": 4, "part": "both"}, r"part is 'both'; allowed: 'total', 'direct', 'indirect'"),
        ({"spp": 4, "part": "indirect"}, r"max_depth is 2 with part='indirect'; allowed: 3 or more"),
        ({"spp": 4, "pixel": "centre"}, r"pixel is 'centre'"),
        ({"spp": 4, "seed": -1}, r"seed is -1"),
    ],
)
def test_bad_arguments(corner: ml.Scene, view: ml.Camera, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ml.SettingsError, match=message):
        make(corner, view, **arguments)


def test_unknown_variant(corner: ml.Scene, view: ml.Camera) -> None:
    with pytest.raises(ml.MiplightError, match="variant is 'llvm_rgb', which does not load here"):
        make(corner, view, 4, variant="llvm_rgb")


def test_without_mitsuba_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(ml.MiplightError, match="pip install") as caught:
        variant.import_mitsuba()
    assert "mitsuba>=3.9,<3.10" in str(caught.value)


def test_other_versions_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    import mitsuba

    monkeypatch.setattr(mitsuba, "__version__", "3.10.0")
    with pytest.raises(ml.MiplightError, match=r"mitsuba is 3\.10\.0; allowed: 3\.9\.x"):
        variant.import_mitsuba()


def test_passes() -> None:
    from miplight.mitsuba.reference import plan_passes  # type: ignore[attr-defined]

    for spp in (1, 3, 16, 100, 1024, 8192, 10000):
        per_pass, passes = plan_passes(spp)
        assert per_pass in (1, 4, 16, 64, 256)
        assert passes % 2 == 0
        assert passes >= 4
        assert spp <= per_pass * passes < spp + max(4, 2 * per_pass)
