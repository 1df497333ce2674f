//! The settings of light propagation volumes, for `indirect` lpv.

use super::spec::{Default, Kind, Spec};
use super::table::{choice, int};

const fn share(name: &'static str, exclusive: bool, default: f64, doc: &'static str, source: &'static str) -> Spec {
    let kind = Kind::Float { min: 0.0, max: 1.0, exclusive };
    Spec { name, kind, default: Default::Float(default), pending: false, nullable: false, unit: "", doc, source }
}

/// Settings of light propagation volumes, in the order in which they are documented.
pub(super) const LPV: &[Spec] = &[
    int(
        "lpv_samples",
        [16, 262_144],
        16_384,
        "Samples all over the scene's surfaces, evenly by area, whose light is left in the volume; a mesh has one at least. \
         They move with their meshes.",
        "[KJ16 Sec. 3.2; Yuk15]",
    ),
    int("lpv_rays", [1, 1024], 16, "Points on lights that each side of a sample asks for light.", "[KJ16 Sec. 3.2]"),
    Spec {
        unit: "cells",
        ..int(
            "lpv_resolution",
            [16, 128],
            24,
            "Cells along the longest edge of the scene, one of margin at each end with them; along the others as many as \
             are needed.",
            "[KD10]",
        )
    },
    int(
        "lpv_cascades",
        [1, 4],
        1,
        "Volumes, each but the first a cube of half the edge of the one that it lies in, with as many cells along an edge and \
         steps of its own, about what the camera sees: for scenes that are much larger than that.",
        "[KD10 Sec. 4.1]",
    ),
    int(
        "lpv_iterations",
        [0, 1024],
        64,
        "Steps of light from cell to cell: light along an axis takes two a cell; three times the resolution for all of it.",
        "[KD10 Sec. 3.5]",
    ),
    choice(
        "lpv_injection",
        &["flux", "paper"],
        &["flux", "paper"],
        "flux",
        "What is left in a cell: the flux that its samples reflect, or as the paper's text has it their mean, however much \
         surface it holds.",
        "[KJ16 Sec. 3.2]",
    ),
    choice(
        "lpv_transport",
        &["sides", "together", "faces"],
        &["sides", "together", "faces"],
        "sides",
        "How light goes on: as a lobe about its net flow, that of the surfaces of each of six sides by itself, so that it \
         never comes back to them; all together, in a quarter of the time; or from each face of a cell as a clamped \
         cosine, as is usual, which is dark a few cells away from what reflects.",
        "[KD10 Sec. 3.5]",
    ),
    share(
        "lpv_most_flow",
        true,
        0.7,
        "Net flow of light at most, as a share of all light of a cell: 1 lets it be a beam, 2/3 a clamped cosine; smaller \
         values are smoother and carry less far, larger ones leave streaks in 24 directions.",
        "[KD10]",
    ),
    share(
        "lpv_reflection",
        false,
        0.0,
        "Share of light that surfaces reflect again inside the volume, all colours alike; 0: one bounce.",
        "[KD10 Sec. 3.7]",
    ),
];
