//! Names of the passes, as in the times, by what needs them.

/// Passes that find what each pixel sees.
pub const GEOMETRY: [&str; 3] = ["geometry/primary_rays", "geometry/trace", "geometry/gbuffer"];
/// Passes of direct light.
pub const DIRECT: [&str; 5] =
    ["direct/light_samples", "direct/receivers", "direct/shadow", "direct/gather", "direct/gather_ratio"];
/// Passes of occlusion by voxels; the last for each list of receivers.
pub const VOXELS: [&str; 3] = ["direct/voxelize", "direct/voxel_blocks", "direct/voxel_shadow"];
/// Passes of occlusion by shadow maps; the last for each list of receivers.
pub const MAPS: [&str; 3] = ["direct/map_rays", "direct/map_trace", "direct/map_shadow"];
/// Passes of direct light where shadows decide what is worth a ray.
pub const ADAPTIVE: [&str; 15] = [
    "direct/light_bounds",
    "direct/prove",
    "direct/compact",
    "direct/cell_rays",
    "direct/cell_shadow",
    "direct/cells",
    "direct/zone",
    "direct/penumbra_rays",
    "direct/penumbra_trace",
    "direct/penumbra",
    "direct/zone_rays",
    "direct/zone_shadow",
    "direct/share",
    "direct/smooth_share",
    "direct/uniform_levels",
];
/// Passes that choose the fragments whose middle is shaded.
pub const FRAGMENTS: [&str; 4] =
    ["direct/pyramid", "direct/one_pass", "direct/fragment_list", "direct/fragment_receivers"];
/// Passes that look at fragments level by level, and choose those that are left.
pub const LEVELS: [&str; 2] = ["direct/nodes", "direct/incremental"];
/// Passes that light fragments by what is seen at coarser ones and beside them.
pub const INCREMENTAL: [&str; 2] = ["direct/reuse", "direct/interleaved"];
/// Passes that light fragments by what is seen inside of them.
pub const SUB_FRAGMENTS: [&str; 5] =
    ["direct/sub_bits", "direct/sub_gather", "direct/sub_fragments", "direct/stop_guard", "direct/extra_samples"];
/// Passes that take the fragments' light to the pixels.
pub const UPSAMPLE: [&str; 4] = ["direct/nearest", "direct/bilinear", "direct/edge_aware", "direct/rbf"];
/// What the last of them chooses from, and its form in the paper's text.
pub const RBF: [&str; 2] = ["direct/rbf_samples", "direct/rbf_paper"];
/// Where refinement ends early.
pub const BILATERAL: &str = "direct/bilateral";
/// What a picture on a light adds to the exact light of its mean.
pub const TEXTURED_SHARE: &str = "direct/textured_share";
/// Exact unshadowed light times the share that is seen.
pub const IRRADIANCE: &str = "direct/irradiance";
/// What the lobes of surfaces reflect of the lights.
pub const SPECULAR: &str = "direct/specular";
/// By the integral over the part of an area light that a lobe reaches, times the share of it that is seen.
pub const LOBE_INTEGRAL: [&str; 3] = ["direct/lobe_integral", "direct/lobe_rays", "direct/lobe_ratio"];
/// On fragments of their own, by samples in the lobe.
pub const LOBES: [&str; 5] =
    ["direct/lobe_levels", "direct/lobe_points", "direct/lobe_ask", "direct/lobe_visible", "direct/lobe_gather"];
/// Passes of indirect light by a final gather.
pub const INDIRECT: [&str; 5] =
    ["indirect/gather_rays", "indirect/trace", "indirect/gather_hits", "indirect/shadow", "indirect/gather_sum"];
/// Passes of a final gather at points between the pixels.
pub const POINTS: [&str; 5] = [
    "indirect/point_pixels",
    "indirect/point_list",
    "indirect/point_rays",
    "indirect/point_sums",
    "indirect/point_smooth",
];
/// Passes of indirect light by a propagation volume; the first two and the last where nothing of it is kept.
pub const LPV: [&str; 7] = [
    "indirect/surface_samples",
    "indirect/blockers",
    "indirect/sample_rays",
    "indirect/inject",
    "indirect/propagate",
    "indirect/look_up",
    "indirect/blockers_trace",
];
/// Passes that find where lights shine, and what is reflected there.
pub const RSM: [&str; 2] = ["indirect/rsm_rays", "indirect/rsm_trace"];
/// Virtual lights of all sizes.
pub const RSM_TREE: &str = "indirect/rsm_tree";
/// Passes that choose virtual lights for all fragments.
pub const VPLS: [&str; 3] = ["indirect/vpl_grid", "indirect/vpl_importance", "indirect/vpl_clusters"];
/// Passes that choose the fragments that virtual lights shine on; the last where every pixel is one.
pub const VPL_FRAGMENTS: [&str; 6] = [
    "indirect/pyramid",
    "indirect/one_pass",
    "indirect/iterative",
    "indirect/fragment_list",
    "indirect/fragment_receivers",
    "indirect/receivers",
];
/// Passes that take the light of virtual lights to them.
pub const TRANSPORT: [&str; 3] = ["indirect/vpl_gather", "indirect/vpl_splat", "indirect/light_cut"];
/// Passes of fragments for each virtual light.
pub const VPL_LISTS: [&str; 4] =
    ["indirect/vpl_points", "indirect/vpl_lists", "indirect/vpl_levels", "indirect/vpl_pixels"];
/// Passes that find how much of it arrives.
pub const VPL_VISIBLE: [&str; 3] = ["indirect/vpl_rays", "indirect/vpl_shadow", "indirect/vpl_visible"];
/// Passes that take it to the pixels.
pub const VPL_UPSAMPLE: [&str; 6] = [
    "indirect/nearest",
    "indirect/bilinear",
    "indirect/edge_aware",
    "indirect/rbf_samples",
    "indirect/rbf",
    "indirect/rbf_paper",
];
/// From irradiance to radiance.
pub const COMPOSITE: &str = "composite/composite";
/// From internal pixels to the image's.
pub const DOWNSAMPLE: &str = "composite/downsample";
