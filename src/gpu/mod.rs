//! The GPU base: knows wgpu and nothing of light.
//!
//! ```text
//! Gpu ── kernel("passes/gather/gather", "main", &[]) ──► Kernel      (compiled once, kept)
//!  │                                                        │
//!  └─ record(cancel) ──► Recorder ── pass("gather", &kernel).bind("hits", &hits).dispatch(n)
//!                           │
//!                           └─ finish() ──► Times { stages, total_ms }
//! ```

mod bind;
mod context;
mod kernel;
mod landing;
pub mod layout;
mod locate;
mod pass;
mod raster;
mod readback;
mod recorder;
mod reflect;
mod resource;
mod shader;
mod staging;
mod timing;
mod view;

pub use context::{AdapterFacts, Gpu, adapters, choose};
pub use kernel::Kernel;
pub use pass::Pass;
pub use raster::Target;
pub use readback::{Landed, Readback, Ticket};
pub use recorder::{Cancel, Recorder, never};
pub use reflect::{Binding, BindingKind, Reflection};
pub use resource::{Buffer, Resources, Slice, Usage};
pub use shader::{ShaderText, compile, files, source};
pub use timing::Times;
pub use view::{View, ViewMut};
