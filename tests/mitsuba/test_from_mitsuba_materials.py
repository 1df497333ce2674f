"""Mitsuba's BSDFs and emitters as ours, and what is reported about them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import miplight as ml
from miplight.from_mitsuba import load
from tests.mitsuba.xml_scenes import write

pytestmark = pytest.mark.mitsuba


# -- materials


@pytest.mark.parametrize("kind", ["plastic", "roughplastic"])
@pytest.mark.parametrize("nonlinear", [False, True])
def test_plastic_keeps_the_albedo_of_its_base(mi: Any, kind: str, nonlinear: bool) -> None:
    """Energy of the base under the coat, by Mitsuba's own integral of the BSDF without its gloss."""
    node: dict[str, Any] = {
        "type": kind,
        "diffuse_reflectance": {"type": "rgb", "value": [0.8, 0.5, 0.2]},
        "specular_reflectance": 0.0,
        "nonlinear": nonlinear,
    }
    if kind == "roughplastic":
        node["alpha"] = 0.05
    mapped = load({"type": "scene", "a": {"type": "cube", "b": {"type": "twosided", "c": node}}})
    albedo = _bihemispherical(mi, mi.load_dict(node))
    np.testing.assert_allclose(mapped.meshes["a"].material.albedo, albedo, rtol=0.03)
    assert not np.allclose(albedo, (0.8, 0.5, 0.2), rtol=0.05)  # negative control: the coat counts


def _bihemispherical(mi: Any, bsdf: Any, count: int = 400_000) -> Any:
    import drjit as dr

    rng = np.random.default_rng(4)
    r, phi, r2, phi2 = (rng.uniform(size=count) for _ in range(4))

    def direction(a: Any, b: Any) -> Any:
        radius, angle = np.sqrt(a), 2 * np.pi * b
        xyz = (radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - a))
        return mi.Vector3f(*(component.astype(np.float32) for component in xyz))

    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi, wo = direction(r, phi), direction(r2, phi2)
    value = np.array(bsdf.eval(mi.BSDFContext(), si, wo)) * np.pi / np.array(wo.z)
    return value.mean(axis=1)


def test_metals_and_the_rest() -> None:
    T = {"type": "rgb", "value": [0.2, 0.4, 0.6]}
    bsdfs: dict[str, Any] = {
        "copper": {"type": "roughconductor", "material": "Cu"},
        "mirror": {"type": "conductor", "specular_reflectance": 0.7},
        "clay": {"type": "principled", "base_color": T},
        "dents": {
            "type": "bumpmap",
            "t": {"type": "bitmap", "data": _tensor(), "raw": True},
            "b": {"type": "diffuse", "reflectance": T},
        },
        "holes": {
            "type": "mask",
            "opacity": 0.5,
            "b": {"type": "twosided", "b": {"type": "diffuse", "reflectance": T}},
        },
    }
    shapes = {name: {"type": "cube", "bsdf": bsdf} for name, bsdf in bsdfs.items()}
    scene = load({"type": "scene", **shapes, "pane": {"type": "cube", "bsdf": {"type": "dielectric"}}})
    albedo = {name: mesh.material.albedo for name, mesh in scene.meshes.items()}
    assert albedo["copper"][0] > albedo["copper"][1] > albedo["copper"][2] > 0.4
    np.testing.assert_allclose(albedo["mirror"], 0.7, rtol=1e-6)
    for name in ("clay", "dents", "holes"):
        np.testing.assert_allclose(albedo[name], (0.2, 0.4, 0.6), rtol=1e-6)
    assert "pane" not in scene.meshes
    notes = "\n".join(scene.report.notes)
    for name, words in {
        "copper": "mirror reflection",
        "mirror": "mirror reflection",
        "clay": "base colour alone",
        "dents": "bump map",
        "holes": "opacity",
        "pane": "left out so that light passes",
    }.items():
        assert any(words in note and name in note for note in scene.report.notes), (name, notes)
    assert "holes" not in next(note for note in scene.report.notes if "both sides" in note)


def _tensor() -> Any:
    from drjit.scalar import TensorXf

    return TensorXf(np.full((2, 2, 1), 0.5, np.float32))


def test_one_sided_surfaces_are_reported(tmp_path: Path) -> None:
    scene = load(write(tmp_path, '<shape type="cube" id="a"/><shape type="cube" id="b"/>'))
    assert scene.report.notes == ("reflects on both sides here, on its front alone in the file: a, b",)


# -- lights


@pytest.mark.parametrize("flipped", [False, True])
def test_area_light_on_two_triangles(tmp_path: Path, flipped: bool) -> None:
    """As Cornell's luminaire: the corners in any order, the side that the normals say."""
    normal = "vn 0 -1 0\n" if not flipped else "vn 0 1 0\n"
    faces = "f 1//1 2//1 3//1\nf 4//1 1//1 3//1\n" if not flipped else "f 1//1 3//1 2//1\nf 4//1 3//1 1//1\n"
    (tmp_path / "lamp.obj").write_text(f"v 3 5 2\nv 3 5 4\nv 1 5 4\nv 1 5 2\n{normal}{faces}")
    emitter = '<emitter type="area"><rgb name="radiance" value="1 2 3"/></emitter>'
    scene = load(
        write(tmp_path, f'<shape type="obj"><string name="filename" value="lamp.obj"/>{emitter}</shape>')
    )
    lamp = scene.lights["lamp"]
    assert isinstance(lamp, ml.AreaLight)
    np.testing.assert_allclose(lamp.normal, (0, 1 if flipped else -1, 0), atol=1e-9)
    assert lamp.area == pytest.approx(4.0)
    centre = lamp.corner + 0.5 * (lamp.edge_u + lamp.edge_v)
    np.testing.assert_allclose(centre, (2, 5, 3), atol=1e-9)
    assert scene.report.notes == ("its surface reflects in the file, and is black here: lamp",)


def test_flipped_rectangle_emits_on_the_other_side() -> None:
    node = {"type": "rectangle", "emitter": {"type": "area"}}
    for flip in (False, True):
        lamp = load({"type": "scene", "l": {**node, "flip_normals": flip}}).lights["l"]
        assert isinstance(lamp, ml.AreaLight)
        np.testing.assert_allclose(lamp.normal, (0, 0, -1 if flip else 1))


def test_spot_with_a_falloff_is_reported(tmp_path: Path) -> None:
    pose = '<transform name="to_world"><lookat origin="1, 2, 3" target="1, 0, 3" up="1, 0, 0"/></transform>'
    values = '<rgb name="intensity" value="4 5 6"/><float name="cutoff_angle" value="35"/>'
    body = f'<emitter type="spot" id="s">{pose}{values}</emitter>'
    scene = load(write(tmp_path, body))
    spot = scene.lights["s"]
    assert isinstance(spot, ml.SpotLight)
    np.testing.assert_allclose(spot.position, (1, 2, 3))
    np.testing.assert_allclose(spot.direction, (0, -1, 0), atol=1e-7)
    np.testing.assert_allclose(spot.intensity, (4, 5, 6))
    assert spot.cutoff == pytest.approx(35.0)
    assert "falls off" in scene.report.notes[0]
