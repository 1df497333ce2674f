//! Where lights are sampled.

pub mod light_samples;
pub mod rsm_rays;
pub mod rsm_tree;
pub mod virtual_light;
pub mod vpl_clusters;
pub mod vpl_grid;
pub mod vpl_importance;
