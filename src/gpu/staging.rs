//! Small uniforms of many dispatches in one buffer, written with one copy before they run.

use crate::error::{Error, Result};
use crate::gpu::context::Gpu;

/// 64 KiB hold 256 dispatches at the coarsest alignment; when it is full, what is recorded is submitted.
const CAPACITY: usize = 64 << 10;

/// Uniforms recorded and not yet submitted.
pub(crate) struct Staging {
    pub(crate) raw: wgpu::Buffer,
    bytes: Vec<u8>,
    align: usize,
}

impl Staging {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self> {
        let raw = gpu.scoped("uniform staging", || {
            gpu.device().create_buffer(&wgpu::BufferDescriptor {
                label: Some("uniforms"),
                size: CAPACITY as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })?;
        let align = gpu.limits().min_uniform_buffer_offset_alignment.max(16) as usize;
        Ok(Self { raw, bytes: Vec::new(), align })
    }

    /// True when uniforms of these sizes still fit.
    pub(crate) fn fits(&self, sizes: impl Iterator<Item = usize>) -> bool {
        let slots: usize = sizes.map(|s| s.next_multiple_of(self.align)).sum();
        self.bytes.len() + slots <= CAPACITY
    }

    /// Adds one uniform and returns its byte offset.
    pub(crate) fn push(&mut self, data: &[u8]) -> Result<u32> {
        if !self.fits(std::iter::once(data.len())) {
            return Err(Error::Device(format!(
                "a uniform of {} bytes does not fit into {CAPACITY}; bind a buffer",
                data.len()
            )));
        }
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(data);
        self.bytes.resize(self.bytes.len().next_multiple_of(self.align), 0);
        Ok(offset as u32)
    }

    /// Schedules the copy that goes before the next submission, and starts anew.
    pub(crate) fn flush(&mut self, queue: &wgpu::Queue) {
        if !self.bytes.is_empty() {
            queue.write_buffer(&self.raw, 0, &self.bytes);
            self.bytes.clear();
        }
    }
}
