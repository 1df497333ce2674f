//! Parts of the native trace.
mod asked;
pub(super) mod dispatch;
pub(super) mod instance;
mod packet;
mod pixels;
mod portal;
pub(super) mod prove;
mod rays;
mod scene;
mod separate;
mod shadow;
mod shaft;
mod simd;
mod simd_pair;
mod simd_portable;
#[cfg(target_arch = "x86_64")]
mod simd_x86;
mod single;
mod triangle;
