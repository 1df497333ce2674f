//! What settings ask of a frame.

use crate::settings::Settings;

/// Whether shadows decide what is worth a ray.
pub fn is_adaptive(settings: &Settings) -> bool {
    let coarse = settings.int("coarsest_level") > 0;
    coarse && refines_direct(settings) && settings.is("direct_estimator", "ratio")
}

/// Whether fragments are chosen level by level.
pub fn is_by_level(settings: &Settings) -> bool {
    is_incremental(settings) || is_sub_fragment(settings)
}

/// Whether a fragment's neighbours decide what is split.
pub fn is_incremental(settings: &Settings) -> bool {
    settings.is("refine", "incremental") && has_fragments(settings)
}

/// Whether a fragment is tested inside.
pub fn is_sub_fragment(settings: &Settings) -> bool {
    settings.is("refine", "sub-fragment") && has_fragments(settings)
}

/// Whether what fragments see of a light is proven where it stops refinement; proofs are true of rays alone, and of the
/// edges of cones.
pub fn guards_stops(settings: &Settings) -> bool {
    is_sub_fragment(settings)
        && settings.is("stop_guard", "bounds")
        && ["ray", "none"].iter().any(|kind| settings.is("visibility", kind))
}

/// Whether large fragments have samples on their borders; only `rbf` makes use of them.
pub fn adds_extra_samples(settings: &Settings) -> bool {
    is_sub_fragment(settings) && settings.is("extra_samples", "on") && settings.is("upsample", "rbf")
}

/// Whether discontinuities of depth or normals split what shadows leave whole.
pub fn splits_by_geometry(settings: &Settings) -> bool {
    settings.float("depth_threshold").is_some() || settings.float("normal_threshold").is_some()
}

/// Whether one point of each fragment is shaded.
pub fn has_fragments(settings: &Settings) -> bool {
    refines_direct(settings) && !settings.is("direct_estimator", "ratio")
}

/// Whether direct light is refined at all.
pub fn refines_direct(settings: &Settings) -> bool {
    !settings.is("refine", "none") && settings.is("direct_refine", "same")
}

/// Whether each virtual light has fragments of its own.
pub fn has_lists_per_light(settings: &Settings) -> bool {
    settings.is("refine_lists", "per-light") && !settings.is("refine", "none") && indirect_from_virtual_lights(settings)
}

/// Whether indirect light comes from a light propagation volume.
pub fn has_volume(settings: &Settings) -> bool {
    settings.is("indirect", "lpv")
}

/// Whether places between the pixels gather, and not every pixel for itself.
pub fn gathers_at_points(settings: &Settings) -> bool {
    settings.is("indirect", "final-gather") && !settings.is("refine", "none")
}

/// Whether indirect light comes from virtual lights.
pub fn indirect_from_virtual_lights(settings: &Settings) -> bool {
    ["splat", "gather", "clustered", "hierarchical"].iter().any(|indirect| settings.is("indirect", indirect))
}
