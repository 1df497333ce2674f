//! Which pixels share their light: tiles and cells that are provably or evidently lit or dark, and the zone between.

pub mod cell_rays;
pub mod cells;
pub mod compact;
pub mod extra_samples;
pub mod incremental;
pub mod iterative;
pub mod light_bounds;
pub mod list_params;
pub mod nodes;
pub mod one_pass;
pub mod penumbra;
pub mod penumbra_rays;
pub mod pyramid;
pub mod stop_guard;
pub mod sub_fragments;
pub mod uniform_levels;
pub mod vpl_levels;
pub mod vpl_lists;
pub mod vpl_points;
pub mod zone;
pub mod zone_rays;
