//! Which pixels share their light: tiles and cells that are provably or evidently lit or dark, and the zone between.

pub mod compact;
pub mod light_bounds;
pub mod one_pass;
pub mod pyramid;
