//! miplight: multiresolution image-space lighting of triangle scenes by area lights.

pub mod error;
pub mod gpu;
/// The passes of a frame.
pub mod passes {
    pub mod arena;
    /// Rays as lists.
    pub mod visibility {
        mod native;
        pub mod trace;
        pub mod trace_native;
        pub mod trace_wgsl;
        mod tree_upload;
    }
}
/// The scene on the host.
pub mod scene {
    pub mod bvh;
}
