"""Mitsuba scenes, XML files or dictionaries, as `miplight.Scene`.

Mitsuba's own parser reads the file (includes, defaults, parameters, references) and its own plugins read the
meshes, images and presets, so this needs the optional extra ``pip install "mitsuba>=3.9,<3.10"``.

How things are taken over:

======================================
==============================================================================
``obj``, ``ply``, ``serialized``        their triangles, UVs and normals (as Mitsuba loads or computes them);
``cube``, ``rectangle``, ``disk``       the same triangles; a disk has 64 of them
``sphere``, ``cylinder``                triangles with exact normals; reported
``diffuse``                             its reflectance, a colour, a bitmap or vertex colours
``plastic``, ``roughplastic``           diffuse, with the same albedo as the base under its coat: ρ_d (1 −
F_e)(1 − F_i) /
                                        (1 − ρ_d F_i), F the mean Fresnel reflectances of the coat; its gloss
                                        is reported
``conductor``, ``roughconductor``       diffuse, of the reflectance at normal incidence; its gloss is reported
``miplight_phong``                      our own plugin (`miplight.mitsuba.phong`): diffuse, of its
                                        ``diffuse_reflectance``, and specular, of its ``specular_reflectance``
                                        (a colour) and ``shininess``
``principled``                          diffuse, of the base colour; the rest is reported
``dielectric``, ``thindielectric``, …   the surface is left out, so that light passes, and reported
``twosided``, ``bumpmap``, ``mask``, …  what is inside; the rest is reported. Here all surfaces reflect on
both sides
``area`` on a parallelogram             `AreaLight`: on a rectangle, or a mesh of two triangles (Cornell's
luminaire).
                                        Visible and black: a reflectance of its own is reported
``spot``                                `SpotLight` with a hard edge at the cutoff; the file's falloff is
reported
``perspective``, ``thinlens``           `Camera`, with crop and principal point; a lens is reported
======================================
==============================================================================

Everything else that would change the picture is refused, by name. Integrators, samplers and films' filters
belong to no scene and are ignored.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from miplight.errors import SceneError
from miplight.mitsuba import plugins
from miplight.mitsuba.variant import activate

from .lights import add_area_light, add_spot
from .nodes import Document, Node
from .sensors import camera_of
from .shapes import add_shape

if TYPE_CHECKING:
    from miplight.scene import Scene

__all__ = ["load"]

# Objects of a scene that say how to render it, not what it is.
_NOT_SCENE = frozenset({"Integrator", "Sampler", "Film", "ReconstructionFilter", "BSDF", "Texture"})


def load(source: str | os.PathLike[str] | dict[str, Any], *, strict: bool = True, **parameters: Any) -> Scene:
    """Read a Mitsuba scene.

    Parameters
    ----------
    source : path or dict
        An XML file, or a dictionary as ``mitsuba.load_dict`` takes it.
    strict : bool, default True
        Refuse a scene with something that cannot be rendered. False leaves it out and reports it.
    **parameters
        Values of the file's ``$name`` parameters.

    Returns
    -------
    Scene
        With its sensors in ``scene.cameras`` and all that was changed or left out in ``scene.report``.

    Raises
    ------
    MiplightError
        If Mitsuba is missing or of another version.
    SceneError
        If the file is missing or broken, and with `strict` for what cannot be rendered, by name.
    """
    from miplight.scene import Scene

    # the scalar variant loads everywhere, and nothing is rendered here
    with activate("scalar_rgb") as mi:
        plugins.register(mi)
        document = Document.parse(mi, source, parameters)
        scene = Scene()
        refused: list[str] = []
        for node in document.root.children():
            try:
                _add(document, scene, node)
            except SceneError as error:
                refused.append(f"{document.describe(node)}: {error}")
        if refused and strict:
            raise SceneError(
                f"{document.name} holds what cannot be rendered; allowed: what miplight.from_mitsuba lists "
                f"(strict=False leaves out the rest):\n" + "\n".join(f"- {line}" for line in refused)
            )
        for line in [*document.notes(), *(f"left out: {line}" for line in refused)]:
            scene._add_note(line)
    return scene


def _add(document: Document, scene: Scene, node: Node) -> None:
    """Take over one child of the scene."""
    add = _ADD.get(node.kind)
    if add is not None:
        add(document, scene, node)
    elif node.kind not in _NOT_SCENE:
        raise SceneError(
            f"plugin is {node.plugin!r}; allowed: shapes, area and spot emitters, perspective sensors"
        )


def _add_shape(document: Document, scene: Scene, node: Node) -> None:
    if node.children("Emitter"):
        add_area_light(document, scene, node)
    else:
        add_shape(document, scene, node)


def _add_emitter(document: Document, scene: Scene, node: Node) -> None:
    if node.plugin == "area":
        return  # shared by reference; the shapes that use it become lights
    if node.plugin != "spot":
        raise SceneError(f"emitter is {node.plugin!r}; allowed: spot, and area on a parallelogram")
    add_spot(document, scene, node)


def _add_sensor(document: Document, scene: Scene, node: Node) -> None:
    camera = camera_of(document, node)
    scene.cameras[document.free_name(node, "camera", scene.cameras)] = camera


_ADD: dict[str, Callable[[Document, Scene, Node], None]] = {
    "Shape": _add_shape,
    "Emitter": _add_emitter,
    "Sensor": _add_sensor,
}
