//! What each pixel sees.

pub mod gbuffer;
pub mod primary_rays;
