//! miplight
#![allow(missing_docs, reason = "module declarations are owned by the crate root on the main branch")]
pub mod scene {
    pub mod bvh;
}
pub mod passes {
    pub mod visibility {
        mod native;
        pub mod trace_native;
    }
}
