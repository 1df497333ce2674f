"""Indirect light from virtual lights: corners, energy, fragments, cuts, visibility."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import miplight as ml

Array = NDArray[np.float64]
ALBEDO, INTENSITY, HEIGHT, CUTOFF, WALL = 0.8, 10.0, 3.0, 35.0, -1.0
VIRTUAL = {"direct": "off", "indirect_visibility": "off", "refine": "none"}
"""Indirect light alone, without occlusion, pixel by pixel."""

LISTS = {"refine": "iterative", "refine_lists": "per-light", "indirect_visibility": "off"}


def _settings(**changes: object) -> ml.Settings:
    return ml.Settings(**{**VIRTUAL, **changes})  # type: ignore[arg-type]


def _corner() -> tuple[ml.Scene, ml.Camera]:
    """A spot straight down on a floor, whose cone reaches a wall."""
    scene = ml.Scene()
    floor = [[-5, 0, -5], [5, 0, -5], [5, 0, 5], [-5, 0, 5]]
    wall = [[-5, 0, WALL], [5, 0, WALL], [5, 6, WALL], [-5, 6, WALL]]
    for name, corners in (("floor", floor), ("wall", wall)):
        mesh = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
        scene.add_mesh(mesh, name=name, material=ml.Material((ALBEDO,) * 3), shading="flat")
    scene.add_light(ml.SpotLight((0, HEIGHT, 0), (0, 0, 0), (INTENSITY,) * 3, cutoff=CUTOFF))
    # a narrow view along the wall's foot: a third of its rows are below 0.03
    return scene, ml.Camera.look_at((0, 0.25, 1.2), (0, 0.2, WALL), fov_y=14, width=24, height=192)


def _wall_irradiance(x: float, y: float) -> float:
    """At (x, y) of the wall from the lit floor: float64 quadrature in polar coordinates about its foot."""
    radius, angle = np.geomspace(1e-5, 6, 1500), np.linspace(0, np.pi, 181)
    r, phi = np.meshgrid(np.sqrt(radius[1:] * radius[:-1]), 0.5 * (angle[1:] + angle[:-1]), indexing="ij")
    area = r * np.diff(radius)[:, None] * np.diff(angle)[None]
    px, pz = x + r * np.cos(phi), WALL + r * np.sin(phi)
    far2 = px**2 + pz**2 + HEIGHT**2
    cosine = HEIGHT / np.sqrt(far2)
    floor = INTENSITY * cosine / far2 * (cosine >= np.cos(np.radians(CUTOFF)))
    d2 = r**2 + y**2
    return float((ALBEDO / np.pi * floor * (r * np.sin(phi)) * y / d2**2 * area).sum())


def _above_the_seam(renderer: ml.Renderer, **changes: object) -> Array:
    """Rows of (height above the floor, irradiance over that of the quadrature), up a column of the wall."""
    scene, camera = _corner()
    frame = renderer.render(scene, camera, _settings(**changes), outputs=("indirect", "position"))
    light = frame.indirect[:, 12, 0].astype(np.float64) * np.pi / ALBEDO
    place = frame.position[:, 12].astype(np.float64)
    on_wall = np.flatnonzero((np.abs(place[:, 2] - WALL) < 1e-4) & (place[:, 1] > 0.004))[::6]
    exact = [_wall_irradiance(place[i, 0], place[i, 1]) for i in on_wall]
    return np.stack([place[on_wall, 1], light[on_wall] / exact], axis=1)


@pytest.mark.parametrize(
    "how",
    [
        {"indirect": "gather", "vpls": 1024},
        {"indirect": "clustered", "vpls": 4096},
        {"indirect": "hierarchical", "vpls": 4096},
    ],
    ids=["gather", "clustered", "hierarchical"],
)
def test_no_band_and_no_spike_along_a_seam(renderer: ml.Renderer, how: dict[str, object]) -> None:
    """Quadrilaterals are right down to the seam, where points and discs lose most of the light (N1)."""
    quad = _above_the_seam(renderer, form_factor="quad", **how)
    assert quad[:, 0].min() < 0.015
    assert len(quad) > 12
    print(f"quad {np.abs(quad[:, 1] - 1).max():.4f}")
    assert np.abs(quad[:, 1] - 1).max() < 0.025
    for form in ("point", "disc"):  # negative controls
        other = _above_the_seam(renderer, form_factor=form, **how)
        off = np.abs(other[other[:, 0] < 0.03, 1] - 1).max()
        print(f"{form} {off:.4f}")
        assert off > 0.08


def _room(size: int) -> tuple[ml.Scene, ml.Camera]:
    """A room with a bumpy body, a spot that lights the body, the floor and two walls."""
    scene = ml.Scene.from_trimesh(ml.shapes.room(boxes=False))
    body = ml.shapes.displaced_sphere(20_000, radius=0.8, amplitude=0.5)
    lift = trimesh.transformations.translation_matrix((0.2, 0.9, -0.1))
    scene.add_mesh(body, name="body", material=ml.Material((0.75, 0.7, 0.6)), transform=lift)
    spot = ml.SpotLight((-1.2, 2.6, 1.6), (0.2, 0.8, -0.6), intensity=(30.0, 26.0, 20.0), cutoff=35.0)
    scene.add_light(spot, name="spot")
    return scene, ml.Camera.look_at((0, 1.5, 5.6), (0, 1.5, 4.6), fov_y=45, width=size, height=size)


def _light(renderer: ml.Renderer, place: tuple[ml.Scene, ml.Camera], settings: ml.Settings) -> ml.Frame:
    frame = renderer.render(*place, settings, outputs=("image", "indirect", "surface_mask"))
    assert frame.indirect_fragments is not None  # read while it is there
    return frame


def _error(frame: ml.Frame, reference: ml.Frame) -> float:
    return ml.metrics.relative_rmse(frame.indirect, reference.indirect, mask=reference.surface_mask)


def _off(name: str) -> ml.Settings:
    return ml.Settings.preset(name).replace(direct="off", indirect_visibility="off")


def test_fragments_cost_little_error(renderer: ml.Renderer) -> None:
    """Clusters gathered at fragments against the same at every pixel; thresholds are dials [NSW09 Fig. 9]."""
    place, settings = _room(256), _off("radiosity-2009")
    every = _light(renderer, place, settings.replace(refine="none"))
    found = []
    for threshold in (1.0, 0.1, 0.0):
        frame = _light(renderer, place, settings.replace(normal_threshold=threshold))
        fragments = frame.indirect_fragments
        assert fragments is not None
        found.append((_error(frame, every), fragments.total))
    print(found)
    assert found[0][0] > found[1][0] > found[2][0]
    assert found[0][1] < found[1][1] < found[2][1]
    assert found[1][0] < 0.04
    assert found[1][1] < 0.25 * 256**2


def test_fragments_are_a_partition(renderer: ml.Renderer) -> None:
    place = _room(133)
    for name in ("splatting-2009", "radiosity-2009", "hierarchical-2009"):
        frame = _light(renderer, place, _off(name))
        fragments = frame.indirect_fragments
        assert fragments is not None
        assert fragments.total == sum(fragments.counts)
        assert ((fragments.level_map < 254) == frame.surface_mask).all()
        assert frame.fragments.total == frame.surface_mask.sum(), "direct light is found at every pixel"


@pytest.mark.parametrize("refine", ["none", "one-pass"])
def test_splats_are_what_is_gathered(renderer: ml.Renderer, refine: str) -> None:
    place = _room(96)
    for changes in ({}, {"vpl_radius": 1.5}, {"form_factor": "disc"}, {"vpl_pattern": "importance"}):
        common = {"refine": refine, "vpls": 64, **changes}
        gathered = _light(renderer, place, _settings(indirect="gather", **common))
        splatted = _light(renderer, place, _settings(indirect="splat", **common))
        assert gathered.indirect.any()
        np.testing.assert_allclose(splatted.indirect, gathered.indirect, rtol=1e-5, atol=1e-7)


def test_a_cut_follows_its_threshold(renderer: ml.Renderer) -> None:
    """Error falls with the threshold, evaluations rise, and at zero all finest lights are evaluated."""
    place, settings = _room(48), _off("hierarchical-2009").replace(refine="none", vpls=4096)
    every = _light(renderer, place, settings.replace(light_cut_threshold=0.0))
    for bound, dials in {"error": (0.1, 0.02, 0.005), "contribution": (0.1, 0.02, 0.005)}.items():
        frames = [
            _light(renderer, place, settings.replace(light_cut_bound=bound, light_cut_threshold=dial))
            for dial in dials
        ]
        errors = [_error(frame, every) for frame in frames]
        evaluated = [frame.stats.light_evaluations for frame in frames]
        print(bound, errors, evaluated, every.stats.light_evaluations)
        assert errors == sorted(errors, reverse=True)
        assert evaluated == sorted(evaluated)
        assert errors[-1] < 0.03
        assert evaluated[-1] < 0.6 * every.stats.light_evaluations


def test_coarse_clusters_shine_in_all_their_directions(renderer: ml.Renderer) -> None:
    """Some 100 clusters, where no ball of theirs is near, against all their texels."""
    place = _room(48)
    settings = _off("hierarchical-2009").replace(refine="none", coarsest_vpls=64)
    every = _light(renderer, place, settings.replace(light_cut_threshold=0.0))
    coarse = _light(renderer, place, settings.replace(light_cut_threshold=1.0))
    assert coarse.stats.light_evaluations < every.stats.light_evaluations / 60
    print(_error(coarse, every))
    assert _error(coarse, every) < 0.05
    seen = every.surface_mask
    assert coarse.indirect[seen].mean() == pytest.approx(every.indirect[seen].mean(), rel=0.02)


def test_few_virtual_lights_come_near_many(renderer: ml.Renderer) -> None:
    """At equal number, clusters and importance are no worse than a grid; all have the energy of many."""
    place = _room(64)
    many = _light(renderer, place, _settings(indirect="gather", vpls=16_384))
    seen = many.surface_mask
    errors = {}
    for name, changes in {
        "grid": {"indirect": "gather", "vpls": 1024},
        "importance": {"indirect": "gather", "vpls": 1024, "vpl_pattern": "importance"},
        "clusters": {"indirect": "clustered", "vpls": 4096},
    }.items():
        frame = _light(renderer, place, _settings(**changes))
        errors[name] = _error(frame, many)
        assert frame.indirect[seen].mean() == pytest.approx(many.indirect[seen].mean(), rel=0.03), name
    print(errors)
    assert max(errors["importance"], errors["clusters"]) < 1.05 * errors["grid"] < 0.4


def test_a_list_for_each_light_follows_its_threshold(renderer: ml.Renderer) -> None:
    """Against every pixel; the list that all share is farther off, and without a threshold little is."""
    place, settings = _room(96), _off("splatting-2009").replace(indirect="gather", vpls=64)
    every = _light(renderer, place, settings.replace(refine="none"))
    shared = _error(_light(renderer, place, settings), every)
    lists = settings.replace(refine_lists="per-light")
    found = [_light(renderer, place, lists.replace(illumination_threshold=t)) for t in (0.3, 0.03, 0.0)]
    errors = [_error(frame, every) for frame in found]
    looks = [frame.stats.light_evaluations for frame in found]
    totals = [frame.indirect_fragments.total for frame in found if frame.indirect_fragments is not None]
    print(errors, shared, looks, totals)
    assert totals == sorted(totals)
    assert totals[0] < 0.7 * totals[2]
    assert errors[0] > errors[1] > errors[2]
    assert looks[0] < looks[1] < looks[2]
    assert errors[1] < 0.5 * shared
    assert errors[2] < 0.01


def test_lobes_reflect_virtual_lights(renderer: ml.Renderer) -> None:
    """A glossy ball over a lit floor: the mirror image of the floor is added to what is diffuse."""
    scene, camera = _room(96)
    scene.remove("body")
    ball = trimesh.creation.icosphere(4, 0.7)
    lift = trimesh.transformations.translation_matrix((0.2, 0.9, -0.1))
    material = ml.Material((0.3, 0.3, 0.3), specular=(0.6, 0.6, 0.6), shininess=40)
    scene.add_mesh(ball, name="ball", material=material, transform=lift)
    settings = _off("splatting-2009").replace(
        indirect="gather", form_factor="disc", refine_lists="per-light", illumination_threshold=0.0, vpls=64
    )
    glossy = _light(renderer, (scene, camera), settings)
    matt = _light(renderer, (scene, camera), settings.replace(specular="off"))
    more = glossy.indirect.astype(np.float64) - matt.indirect
    assert more.max() > 0.5 * matt.indirect.max()
    assert more.min() > -1e-5 * matt.indirect.max()
    np.testing.assert_allclose(glossy.image, glossy.indirect, atol=1e-5)


@pytest.mark.parametrize("light", ["spot", "area", "two-sided"])
def test_visible_light_has_the_energy_of_a_final_gather(renderer: ml.Renderer, light: str) -> None:
    scene, camera = _room(64)
    if light != "spot":
        scene.remove("spot")
        lamp = ml.AreaLight(
            (-0.4, 2.2, 0.4), (0.8, 0, 0), (0, 0, 0.8), (9, 8, 7), two_sided=light == "two-sided"
        )
        scene.add_light(lamp)
    gathered = _light(renderer, (scene, camera), ml.Settings(direct="off", indirect="final-gather"))
    seen = gathered.surface_mask
    energy = gathered.indirect[seen].mean()
    off = _off("hierarchical-2009").replace(form_factor="quad")
    on = off.replace(indirect_visibility="on")
    frame = _light(renderer, (scene, camera), on)
    assert frame.indirect[seen].mean() == pytest.approx(energy, rel=0.05)
    assert _light(renderer, (scene, camera), off).indirect[seen].mean() > 1.08 * energy, "what hides nothing"
    again = _light(renderer, (scene, camera), on)
    assert (again.indirect == frame.indirect).all()


def test_equal_solid_angles_are_an_option(renderer: ml.Renderer) -> None:
    """A wide cone: the corners of its map are given as much as its middle, five times too much (N18)."""
    scene, camera = _room(48)
    scene.lights["spot"].cutoff = 60.0
    exact, equal = (
        _light(renderer, (scene, camera), _settings(indirect="gather", rsm_solid_angle=how))
        for how in ("exact", "equal")
    )
    assert 0.1 < _error(equal, exact) < 1.0


def test_surface_modulation_only_darkens_and_is_off(renderer: ml.Renderer) -> None:
    place = _room(48)
    plain = _light(renderer, place, _settings(indirect="gather"))
    half = _light(renderer, place, _settings(indirect="gather", surface_modulation=0.5))
    seen = plain.surface_mask & (plain.indirect.min(axis=-1) > 0)
    ratio = half.indirect[seen] / plain.indirect[seen]
    assert (ratio <= 1 + 1e-6).all()
    assert (ratio >= 0.5 - 1e-6).all()
    assert ratio.min() < 0.7
    np.testing.assert_allclose(half.image, half.indirect, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"indirect": "splat", "form_factor": "quad"}, "allowed: point, disc"),
        ({"indirect": "final-gather", "indirect_visibility": "off"}, "allowed: on"),
        ({**LISTS, "indirect": "hierarchical"}, "allowed: splat, gather, clustered"),
        ({**LISTS, "indirect": "gather", "form_factor": "quad"}, "allowed: point, disc"),
        ({**LISTS, "indirect": "gather", "indirect_visibility": "on"}, "allowed: off"),
    ],
)
def test_what_does_not_go_together_says_so(
    renderer: ml.Renderer, changes: dict[str, object], part: str
) -> None:
    with pytest.raises(ml.SettingsError, match=part):
        renderer.render(*_room(16), ml.Settings(**changes))  # type: ignore[arg-type]


def test_maps_that_do_not_fit_are_refused(renderer: ml.Renderer) -> None:
    most = renderer.adapter["limits"]["max_storage_buffer_binding_size"]
    maps = most // (1024**2 * 64) + 1
    scene, camera = _room(16)
    for k in range(maps - 1):
        scene.add_light(ml.SpotLight((0, 2, k / 1000), (0, 0, 0), (1, 1, 1), cutoff=30))
    with pytest.raises(ml.SettingsError, match=f"rsm_resolution=1024 .* {maps} reflective shadow maps"):
        renderer.render(scene, camera, _settings(indirect="hierarchical", rsm_resolution=1024))


def test_rays_know_the_parts_of_long_lists(renderer: ml.Renderer) -> None:
    """A list that is summed up in parts is seen like the same light in one part."""
    place = _room(32)
    seen = {}
    for count in (16_384, 65_536):
        settings = _settings(indirect="gather", form_factor="quad", vpls=count)
        off, on = (
            _light(renderer, place, settings.replace(indirect_visibility=how, indirect_rays=64))
            for how in ("off", "on")
        )
        mask = off.surface_mask
        seen[count] = on.indirect[mask].mean() / off.indirect[mask].mean()
    print(seen)
    assert 0.5 < seen[16_384] < 0.98
    assert seen[65_536] == pytest.approx(seen[16_384], rel=0.02)
