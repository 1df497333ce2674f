//! The table of settings: each stated once, with its range, unit and source; those of virtual lights stand beside it.

use super::spec::{Default, Kind, Spec};

pub(super) const OFF_ON: &[&str] = &["off", "on"];

pub(super) const fn choice(
    name: &'static str,
    choices: &'static [&'static str],
    available: &'static [&'static str],
    default: &'static str,
    doc: &'static str,
    source: &'static str,
) -> Spec {
    let kind = Kind::Choice { choices, available };
    Spec { name, kind, default: Default::Text(default), pending: false, nullable: false, unit: "", doc, source }
}

pub(super) const fn int(
    name: &'static str,
    range: [i64; 2],
    default: i64,
    doc: &'static str,
    source: &'static str,
) -> Spec {
    let kind = Kind::Int { min: range[0], max: range[1], only: &[] };
    Spec { name, kind, default: Default::Int(default), pending: false, nullable: false, unit: "", doc, source }
}

const fn later(name: &'static str, kind: Kind, unit: &'static str, doc: &'static str, source: &'static str) -> Spec {
    Spec { name, kind, default: Default::None, pending: true, nullable: true, unit, doc, source }
}

const fn level(name: &'static str, default: i64, doc: &'static str, source: &'static str) -> Spec {
    Spec { unit: "level", ..int(name, [0, 16], default, doc, source) }
}

pub(super) const fn threshold(name: &'static str, default: f64, doc: &'static str, source: &'static str) -> Spec {
    let kind = Kind::Float { min: 0.0, max: f64::MAX, exclusive: false };
    Spec { name, kind, default: Default::Float(default), pending: false, nullable: true, unit: "", doc, source }
}

pub(super) const POSITIVE: Kind = Kind::Float { min: 0.0, max: f64::MAX, exclusive: true };

/// Settings of all but virtual lights, in the order in which they are documented.
pub(super) const GENERAL: &[Spec] = &[
    choice("direct", OFF_ON, OFF_ON, "on", "Light that comes straight from the lights.", "[SW91]"),
    choice(
        "indirect",
        &["off", "splat", "gather", "clustered", "hierarchical", "lpv", "final-gather"],
        &["off", "splat", "gather", "clustered", "hierarchical", "lpv", "final-gather"],
        "off",
        "How light that was reflected before is found: by rays from each pixel (`final-gather`), or from virtual lights in \
         reflective shadow maps: each of a list splatted, or gathered from; clusters of them; a cut through their tree for \
         each fragment; or from a light propagation volume (`lpv`).",
        "[Kaj86; NW09; NSW09; KJ16]",
    ),
    choice(
        "indirect_visibility",
        OFF_ON,
        OFF_ON,
        "on",
        "Occlusion between a surface and what lights it indirectly; with `lpv` whether surfaces stop light that propagates; \
         `final-gather` has no choice.",
        "[NW09]",
    ),
    choice(
        "refine",
        &["none", "iterative", "one-pass", "incremental", "sub-fragment"],
        &["none", "iterative", "one-pass", "incremental", "sub-fragment"],
        "none",
        "How fragments are split; `none` shades every pixel.",
        "[NW09; NSW09; NPW10; KJ16]",
    ),
    choice(
        "direct_refine",
        &["same", "none"],
        &["same", "none"],
        "same",
        "Whether direct light has fragments as `refine` says, or is found at every pixel while indirect light has them.",
        "[NW09]",
    ),
    choice(
        "visibility",
        &["none", "voxel", "ray", "shadow-map"],
        &["none", "voxel", "ray", "shadow-map"],
        "ray",
        "How it is found whether a light sample is seen: `ray` is exact; `voxel` marches through the voxels of what \
         the camera's view holds; `shadow-map` looks into a coarse map of each sample. The last two not where `refine` \
         is one-pass and `direct_estimator` is ratio.",
        "[KJ16]",
    ),
    choice(
        "visibility_reuse",
        &["off", "incremental"],
        &["off", "incremental"],
        "off",
        "Reuse of the bits on which coarser fragments agree; matters only where a fragment is finer than others.",
        "[NPW10]",
    ),
    choice(
        "shadow_proofs",
        OFF_ON,
        OFF_ON,
        "on",
        "Whether tiles of which a test of bounds proves that they see all or nothing of a light are left unasked; \
         matters only where `refine` is not none and `direct_estimator` is ratio.",
        "[HW91]",
    ),
    choice(
        "penumbra_filter",
        OFF_ON,
        OFF_ON,
        "on",
        "Whether the visible share of a light, and nothing else, is averaged as far as the penumbra is wide; matters \
         only where `refine` is not none and `direct_estimator` is ratio.",
        "[MWR12]",
    ),
    choice(
        "specular_visibility",
        &["ray", "variance"],
        &["ray", "variance"],
        "ray",
        "Visibility of the specular part: rays to samples in the lobe, or the variance of distances to occluders.",
        "[NPW10 Sec. 3.3.3]",
    ),
    choice(
        "upsample",
        &["nearest", "bilinear", "edge-aware", "rbf"],
        &["nearest", "bilinear", "edge-aware", "rbf"],
        "nearest",
        "From fragments to pixels; with one fragment a pixel there is nothing to interpolate, and with \
         `direct_estimator` ratio only the visible share is, see `penumbra_filter`.",
        "[NW09; KJ16]",
    ),
    choice(
        "form_factor",
        &["point", "disc", "quad"],
        &["point", "disc", "quad"],
        "point",
        "What a virtual light is taken for: a point, a disc, or near it the exact quadrilateral of its texels.",
        "[NSW09 Eq. 1]",
    ),
    int(
        "light_samples",
        [1, 4096],
        256,
        "Strata of equal area on each area light. With `refine` one-pass and `direct_estimator` ratio the most that a \
         pixel may ask of 256: below 64 one of 16, below 256 four, from 1024 on all in every penumbra.",
        "[NPW10 Eq. 2]",
    ),
    choice(
        "direct_estimator",
        &["samples", "ratio"],
        &["samples", "ratio"],
        "samples",
        "Direct light of an area light: the sum over its visible samples, or its exact unshadowed integral times the \
         visible share of the samples.",
        "[HHM18]",
    ),
    choice(
        "light_pattern",
        &["grid", "jittered"],
        &["grid", "jittered"],
        "jittered",
        "Where in its stratum a sample lies: in the middle, or at a place that differs from pixel to pixel.",
        "[CPC84]",
    ),
    level("coarsest_level", 4, "Level of the largest fragments.", "[NW09]"),
    level(
        "finest_level",
        0,
        "Level of the smallest fragments, at most `coarsest_level`; 0 or 1 where `direct_estimator` is ratio.",
        "[NPW10]",
    ),
    choice(
        "depth_metric",
        &["range", "derivative", "plane"],
        &["range", "derivative", "plane"],
        "plane",
        "What `depth_threshold` is compared with: the range of depth (scene units), the change of depth from pixel to \
         pixel over a pixel's width, or the distance to the mean tangent plane over the fragment's width.",
        "[NW09; NPW10]",
    ),
    threshold(
        "depth_threshold",
        0.05,
        "Depth discontinuity above which a fragment is split, in the unit of `depth_metric`; None: never.",
        "[NW09]",
    ),
    choice(
        "normal_metric",
        &["component", "cone", "curvature"],
        &["component", "cone", "curvature"],
        "cone",
        "What `normal_threshold` is compared with: the range of any component of the normal, its largest difference \
         from the mean normal, or the largest curvature times the fragment's width.",
        "[NW09; KJ16]",
    ),
    threshold(
        "normal_threshold",
        0.25,
        "Difference of unit normals above which a fragment is split; None: never.",
        "[NW09]",
    ),
    threshold(
        "illumination_threshold",
        0.1,
        "Difference of irradiance between neighbours of a level, over the mean irradiance, above which a fragment is \
         split; `refine` incremental only; None: never.",
        "[NPW10 Sec. 3.4]",
    ),
    Spec {
        unit: "bits",
        nullable: true,
        ..int(
            "bit_threshold",
            [1, 4096],
            128,
            "Visibility bits of all `light_samples` on which a neighbourhood of 3 x 3 differs, from which on a fragment \
             is split; `refine` incremental; of sub-fragments with `refine` sub-fragment; None: never.",
            "[NPW10 Sec. 3.3.2; KJ16 Sec. 3.1.2]",
        )
    },
    Spec {
        unit: "voxels",
        ..int("voxel_resolution", [16, 2048], 256, "Voxels along the longer side of the view.", "[NPW10 Sec. 4.2]")
    },
    Spec {
        unit: "voxels",
        kind: Kind::Multiple { min: 32, max: 2048, of: 32 },
        ..int("voxel_slices", [32, 2048], 128, "Voxels along depth, a multiple of 32.", "[NPW10 Sec. 4.2]")
    },
    choice(
        "voxel_march",
        &["uniform", "dda"],
        &["uniform", "dda"],
        "uniform",
        "How a ray goes through the voxels: in equal steps, each of which looks at several slices, or voxel by voxel.",
        "[NPW10 Sec. 3.3.1]",
    ),
    Spec {
        default: Default::None,
        nullable: true,
        ..int(
            "voxel_steps",
            [2, 2048],
            128,
            "Steps of a ray through the voxels at most; None: 128, or half of `voxel_resolution` where that is more; \
             `voxel_march` uniform only.",
            "[NPW10 Sec. 3.3.1]",
        )
    },
    Spec {
        unit: "voxels",
        nullable: false,
        ..threshold(
            "voxel_bias",
            1.0,
            "How far a marched ray starts off its surface, and ends off the light's; a voxel is as wide as it is along \
             the normal.",
            "[NPW10 Sec. 4.3]",
        )
    },
    Spec {
        unit: "of the image",
        nullable: false,
        ..threshold(
            "voxel_margin",
            0.0,
            "By how much of the image the voxels reach beyond each of its sides, so that occluders off screen count.",
            "[NPW10]",
        )
    },
    Spec {
        unit: "texels",
        ..int(
            "shadow_map_resolution",
            [8, 1024],
            64,
            "Width of the map of each light sample; a spot's one map is as wide as those of all samples side by side; `visibility` \
             shadow-map only.",
            "[NPW10 Sec. 4]",
        )
    },
    Spec {
        unit: "pixels",
        kind: Kind::Int { min: 1, max: 2, only: &[] },
        ..int(
            "interleave",
            [1, 2],
            1,
            "Width of the interleaved sampling pattern: with 2 a fragment asks every fourth sample, and its neighbours \
             the others; with `refine` sub-fragment so does each of its four sub-fragments; those two only.",
            "[NPW10 Sec. 3.3.2]",
        )
    },
    choice(
        "sub_fragment_samples",
        &["same", "own"],
        &["same", "own"],
        "same",
        "Whether the four sub-fragments that are compared ask the same light samples, or each a fourth of all; then nearly \
         every penumbra is refined to pixels. `refine` sub-fragment only.",
        "[KJ16 Sec. 3.1.2]",
    ),
    Spec {
        unit: "bits",
        nullable: true,
        ..int(
            "gradient_threshold",
            [0, 4096],
            4,
            "Samples between sub-fragments beside each other, of those that each of them asks, above which both are split \
             together with their fragment; `refine` sub-fragment only; None: never.",
            "[KJ16 Sec. 3.1.3]",
        )
    },
    choice(
        "gradient_metric",
        &["changes", "counts"],
        &["changes", "counts"],
        "changes",
        "What `gradient_threshold` is compared with: the samples that one sees and the other does not, or the difference of \
         how many each sees, as the paper's text has it, which misses a shadow that moves.",
        "[KJ16 Sec. 3.1.3]",
    ),
    int("rbf_samples", [1, 4], 3, "Fragments that a pixel takes light from; `upsample` rbf only.", "[KJ16 Sec. 3.1.5]"),
    choice(
        "rbf_form",
        &["interpolating", "paper"],
        &["interpolating", "paper"],
        "interpolating",
        "Radial bases that keep a constant one and stay in the range of their samples, or those of the paper's text, which \
         do neither; `upsample` rbf only.",
        "[KJ16 Eqs. 1 to 3]",
    ),
    choice(
        "extra_samples",
        OFF_ON,
        OFF_ON,
        "on",
        "Whether fragments above level 2 have three more samples on their borders; `refine` sub-fragment with `upsample` \
         rbf only.",
        "[KJ16 Sec. 3.1.4]",
    ),
    choice(
        "stop_guard",
        &["off", "bounds"],
        &["off", "bounds"],
        "bounds",
        "Whether a fragment above level 2 is split unless bounds prove that it sees all or nothing of each light: something \
         thin may lie between the samples on which its sub-fragments agree. Off is the paper's rule. `refine` \
         sub-fragment with `visibility` ray or, at the edges of spots, none.",
        "[KJ16 Sec. 3.1.3; HW91]",
    ),
    threshold(
        "lobe_threshold",
        0.5,
        "Turn of the mirror direction over a fragment above which it is split, as a share of the lobe's half-width at half \
         maximum; fragments of lobes only; None: never.",
        "[NPW10 Sec. 3.2.1]",
    ),
    Spec {
        kind: Kind::Int { min: 9, max: 289, only: &[9, 25, 49, 81, 121, 169, 225, 289] },
        ..int(
            "lobe_samples",
            [9, 289],
            25,
            "Places in a lobe that are asked where fewer than 9 in 25 of them are samples of the light; fragments of \
             lobes only.",
            "[NPW10 Sec. 3.2.1]",
        )
    },
    choice("specular", OFF_ON, OFF_ON, "on", "The specular part of materials.", "[NPW10 Sec. 3.2.1]"),
    Spec {
        name: "supersample",
        kind: Kind::Int { min: 1, max: 4, only: &[1, 2, 4] },
        default: Default::Int(1),
        pending: false,
        nullable: false,
        unit: "per axis",
        doc: "Internal pixels for each pixel of the image, averaged at the end; fragment maps keep the internal size.",
        source: "[NW09]",
    },
    int("seed", [0, 4_294_967_295], 0, "Another seed gives other sample positions.", ""),
    later("target_error", POSITIVE, "relative", "Error at which the renderer may stop.", ""),
    later("budget_ms", POSITIVE, "ms", "Time that the renderer may take.", ""),
];
