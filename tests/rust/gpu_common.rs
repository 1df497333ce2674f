//! What the tests of the GPU base share.
#![allow(dead_code, reason = "each test binary uses a part")]

use std::sync::{Mutex, MutexGuard, OnceLock};

use miplight::error::Error;
use miplight::gpu::{Gpu, Kernel};

/// Shaders of these tests share a head: the grid and one list.
pub(crate) const HEAD: &str = "
import package::common::grid::{Grid, item_index, group_index, dispatch_size};
@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read_write> out: array<u32>;
";

/// Every thread writes its item's number plus one, and stops beyond the end.
pub(crate) const NUMBER: &str = "
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
        @builtin(local_invocation_index) local: u32) {
    let item = item_index(grid, workgroup, workgroups, 64u, local);
    if item >= grid.end { return; }
    out[item] += item + 1u;
}
";

pub(crate) fn device() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| Gpu::new("auto").expect("these tests need an adapter; Mesa's llvmpipe will do"))
}

/// One at a time: timing and memory figures of one test must not see another.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    LOCK.lock().unwrap_or_else(|e| e.into_inner())
}

pub(crate) fn kernel(body: &str) -> std::sync::Arc<Kernel> {
    device().kernel_from_text("tests/case", &format!("{HEAD}{body}"), "main", &[]).expect("test shader compiles")
}

pub(crate) fn message<T>(result: Result<T, Error>) -> String {
    match result {
        Ok(_) => panic!("an error was expected"),
        Err(e) => e.to_string(),
    }
}
