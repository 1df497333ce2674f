//! The settings of a final gather, for `indirect` final-gather.

use super::spec::{Default, Kind, Spec};
use super::table::int;

/// Settings of a final gather, in the order in which they are documented.
pub(super) const GATHER: &[Spec] = &[
    int("bounces", [1, 64], 1, "Reflections before the last one; `final-gather` only.", "[Kaj86]"),
    int(
        "gather_rays",
        [1, 65_536],
        256,
        "Stratified hemisphere rays of each pixel, or where `refine` is not none of each point that gathers; `final-gather` \
         only.",
        "[WRC88]",
    ),
    int(
        "gather_level",
        [0, 6],
        3,
        "Level of the coarsest blocks of pixels that gather at one point, where `refine` is not none; finer ones where light \
         changes faster. `final-gather` only.",
        "[WRC88]",
    ),
    Spec {
        name: "gather_reach",
        kind: Kind::Float { min: 0.0, max: 100.0, exclusive: true },
        default: Default::Float(0.6),
        pending: false,
        nullable: false,
        unit: "",
        doc: "How far what a point gathered holds for others, as a share of the harmonic mean distance of what its rays met: \
              the error that interpolation may make. `final-gather` with `refine` only.",
        source: "[WRC88]",
    },
];
