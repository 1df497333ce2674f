//! The presets of the API: what each changes.

use super::spec::Default;

/// Settings that a preset changes.
pub type Changes = &'static [(&'static str, Default)];

/// The presets of the API: what they change, or `None` while their passes do not exist yet.
pub const PRESETS: &[(&str, Option<Changes>)] = &[
    (
        "splatting-2009",
        Some(&[
            ("direct_refine", Default::Text("none")),
            ("indirect", Default::Text("splat")),
            ("indirect_visibility", Default::Text("off")),
            ("refine", Default::Text("iterative")),
            ("coarsest_level", Default::Int(6)),
            ("normal_metric", Default::Text("component")),
            ("upsample", Default::Text("edge-aware")),
        ]),
    ),
    (
        "radiosity-2009",
        Some(&[
            ("direct_refine", Default::Text("none")),
            ("indirect", Default::Text("clustered")),
            ("indirect_visibility", Default::Text("off")),
            ("refine", Default::Text("one-pass")),
            ("coarsest_level", Default::Int(3)),
            ("normal_metric", Default::Text("component")),
            ("normal_threshold", Default::Float(0.1)),
            ("upsample", Default::Text("edge-aware")),
            ("form_factor", Default::Text("disc")),
            ("vpls", Default::Int(4096)),
        ]),
    ),
    (
        "hierarchical-2009",
        Some(&[
            ("direct_refine", Default::Text("none")),
            ("indirect", Default::Text("hierarchical")),
            ("indirect_visibility", Default::Text("off")),
            ("refine", Default::Text("one-pass")),
            ("coarsest_level", Default::Int(3)),
            ("normal_metric", Default::Text("component")),
            ("normal_threshold", Default::Float(0.1)),
            ("upsample", Default::Text("edge-aware")),
            ("form_factor", Default::Text("disc")),
            ("vpls", Default::Int(65_536)),
            ("coarsest_vpls", Default::Int(64)),
            ("light_cut_threshold", Default::Float(0.1)),
        ]),
    ),
    (
        "area-2010",
        Some(&[
            ("refine", Default::Text("incremental")),
            ("visibility", Default::Text("voxel")),
            ("visibility_reuse", Default::Text("incremental")),
            ("interleave", Default::Int(2)),
            ("light_pattern", Default::Text("grid")),
            ("upsample", Default::Text("edge-aware")),
            // Slopes fire on every floor that is seen at a grazing angle (N19): the plane metric stays.
            ("normal_metric", Default::Text("component")),
            // 25 places show their shadows one by one.
            ("lobe_samples", Default::Int(81)),
            ("lobe_threshold", Default::Float(0.2)),
            ("normal_threshold", Default::Float(0.5)),
        ]),
    ),
    (
        "area-2016",
        Some(&[
            ("refine", Default::Text("sub-fragment")),
            ("light_samples", Default::Int(64)),
            ("light_pattern", Default::Text("grid")),
            ("normal_metric", Default::Text("curvature")),
            ("interleave", Default::Int(2)),
            ("bit_threshold", Default::Int(1)),
            ("upsample", Default::Text("rbf")),
            ("indirect", Default::Text("lpv")),
        ]),
    ),
    ("brute-force", Some(&[])),
    (
        "default",
        Some(&[
            ("direct_estimator", Default::Text("ratio")),
            ("refine", Default::Text("one-pass")),
            ("visibility_reuse", Default::Text("incremental")),
            ("gather_rays", Default::Int(256)),
            ("coarsest_level", Default::Int(5)),
            // Normals and depths do not matter to what is exact at each pixel: shadows alone refine.
            ("depth_threshold", Default::None),
            ("normal_threshold", Default::None),
        ]),
    ),
];
