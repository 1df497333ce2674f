//! The settings of virtual lights, for `indirect` splat, gather, clustered and hierarchical.

use super::spec::{Default, Kind, Spec};
use super::table::{POSITIVE, choice, int, threshold};

const POWERS: &[i64] = &[16, 32, 64, 128, 256, 512, 1024];
const QUADRUPLES: &[i64] = &[1, 4, 16, 64, 256, 1024, 4096];

const fn only(range: [i64; 2], only: &'static [i64]) -> Kind {
    Kind::Int { min: range[0], max: range[1], only }
}

/// Settings of virtual lights, in the order in which they are documented.
pub(super) const VIRTUAL: &[Spec] = &[
    int(
        "vpls",
        [1, 1_048_576],
        256,
        "Virtual lights for each light: with `vpl_pattern` grid the next square number, of a two-sided area light for \
         each side; with `indirect` clustered and hierarchical the finest that there may be, the next power of four, at \
         most the texels of its map.",
        "[NW09 Sec. 3.1; NSW09 Sec. 3.3]",
    ),
    choice(
        "refine_lists",
        &["shared", "per-light"],
        &["shared", "per-light"],
        "shared",
        "Whether all virtual lights light the same fragments, or each has fragments of its own, split where what surfaces \
         reflect of it differs by more than `illumination_threshold`, and lobes reflect it as well; `indirect` splat, gather \
         and clustered without `indirect_visibility`.",
        "[NW09 Sec. 4.1]",
    ),
    choice(
        "vpl_pattern",
        &["grid", "importance"],
        &["grid", "importance"],
        "grid",
        "Where in a map virtual lights lie: on a regular grid, or as dense as the flux that is reflected there; `indirect` \
         splat and gather only.",
        "[NW09 Sec. 3.1; DS06]",
    ),
    Spec {
        unit: "texels",
        kind: only([16, 1024], POWERS),
        ..int("rsm_resolution", [16, 1024], 256, "Width of each reflective shadow map.", "[DS05; NSW09]")
    },
    choice(
        "rsm_solid_angle",
        &["exact", "equal"],
        &["exact", "equal"],
        "exact",
        "Solid angle of a texel of a spot's map: its own, or the same for all, up to five times too large or small.",
        "[NSW09 Eq. 4]",
    ),
    Spec {
        kind: only([1, 256], &[1, 4, 16, 64, 256]),
        ..int("rsm_light_points", [1, 256], 16, "Points of an area light that share its map; spots have one.", "[DS05]")
    },
    Spec {
        kind: only([1, 4096], QUADRUPLES),
        ..int(
            "coarsest_vpls",
            [1, 4096],
            256,
            "Virtual lights for each map where all clusters are as large as they may be; `indirect` clustered and \
             hierarchical.",
            "[NSW09 Sec. 3.5]",
        )
    },
    choice(
        "cluster_metric",
        &["plane", "range"],
        &["plane", "range"],
        "plane",
        "What cluster thresholds are compared with: the distance to the mean plane over the cluster's radius and the largest \
         difference from the mean normal, or the range of the distance from the light (scene units) and of any component \
         of the normal; `indirect` clustered only.",
        "[NSW09 Sec. 3.4]",
    ),
    threshold(
        "cluster_depth_threshold",
        0.25,
        "Depth discontinuity above which a cluster is split, in the unit of `cluster_metric`; None: never.",
        "[NSW09 Sec. 3.4]",
    ),
    threshold(
        "cluster_normal_threshold",
        0.5,
        "Difference of unit normals above which a cluster is split; None: never.",
        "[NSW09 Sec. 3.4]",
    ),
    Spec {
        nullable: false,
        ..threshold(
            "light_cut_threshold",
            0.01,
            "What `light_cut_bound` bounds of a cluster above which it is split for a fragment: over an estimate of the \
             fragment's irradiance, with paper in W/m2. 0 goes to the finest; `indirect` hierarchical only.",
            "[NSW09 Eq. 7]",
        )
    },
    choice(
        "light_cut_bound",
        &["paper", "contribution", "error"],
        &["paper", "contribution", "error"],
        "error",
        "What decides whether a cluster is split: its contribution as the paper's text has it, from the distance to one of \
         its points, which is no bound; a bound of its contribution from its ball and normals; or the difference between \
         that and the least that it may contribute. `indirect` hierarchical only.",
        "[NSW09 Eq. 8; WFA05]",
    ),
    Spec {
        kind: POSITIVE,
        default: Default::None,
        unit: "scene units",
        ..threshold("vpl_radius", 0.0, "Distance up to which a virtual light reaches; None: everywhere.", "[DS06]")
    },
    int(
        "indirect_rays",
        [1, 1024],
        32,
        "Rays of a fragment towards virtual lights chosen by what they contribute; `indirect_visibility` on.",
        "[WFA05]",
    ),
    Spec {
        kind: Kind::Float { min: 0.0, max: 1.0, exclusive: false },
        nullable: false,
        ..threshold(
            "surface_modulation",
            0.0,
            "How much indirect light darkens where a surface turns away from the eye: a look, no physics.",
            "[NW09 Sec. 4.2]",
        )
    },
];
