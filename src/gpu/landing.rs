//! Where copies land on the host: one buffer that is kept, since drivers take milliseconds to make a large one.

use std::borrow::Cow;

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::gpu::context::{Gpu, lock};
use crate::gpu::resource::Buffer;

/// A larger one is not kept.
const KEPT_BYTES: u64 = 256 << 20;

impl Gpu {
    /// Reads a whole buffer; waits for the work submitted before.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn read<T: Pod + Send>(&self, buffer: &Buffer<T>) -> Result<Vec<T>> {
        self.look(buffer, <[T]>::to_vec)
    }

    /// Shows a whole buffer to `look`, where it lies or where its copy landed; waits for the work submitted before.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn look<T: Pod + Send, R>(&self, buffer: &Buffer<T>, look: impl FnOnce(&[T]) -> R) -> Result<R> {
        if buffer.mappable() || buffer.is_empty() {
            return Ok(look(&self.view(buffer, 0..buffer.len())?));
        }
        let mut encoder = self.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let landing = Landing::of(self, &[buffer], &mut encoder)?;
        self.scoped("reading back", || self.queue().submit([encoder.finish()]))?;
        landing.look(self, |parts| look(parts[0].as_ref()))
    }

    /// A buffer of so many bytes or more to copy to; no one else has it until it is given back.
    pub(crate) fn landing(&self, bytes: u64) -> wgpu::Buffer {
        let kept = lock(&self.shared().landing).take();
        kept.filter(|buffer| buffer.size() >= bytes).unwrap_or_else(|| {
            self.device().create_buffer(&wgpu::BufferDescriptor {
                label: Some("readback"),
                size: bytes,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })
    }

    pub(crate) fn give_back(&self, buffer: wgpu::Buffer) {
        let mut kept = lock(&self.shared().landing);
        if buffer.size() <= KEPT_BYTES && kept.as_ref().is_none_or(|other| other.size() < buffer.size()) {
            *kept = Some(buffer);
        }
    }
}

/// Whole buffers on their way to the host, by a copy that was recorded behind the work on them.
pub(crate) struct Landing {
    raw: wgpu::Buffer,
    /// Bytes of each, and as copied.
    parts: Vec<(u64, u64)>,
}

impl Landing {
    pub(crate) fn of<T: Pod>(gpu: &Gpu, buffers: &[&Buffer<T>], encoder: &mut wgpu::CommandEncoder) -> Result<Self> {
        let size = |buffer: &&Buffer<T>| (buffer.len() * size_of::<T>()) as u64;
        let parts: Vec<(u64, u64)> = buffers.iter().map(size).map(|b| (b, b.next_multiple_of(16))).collect();
        let bytes: u64 = parts.iter().map(|(_, copied)| copied).sum();
        let limit = gpu.limits().max_buffer_size;
        if bytes > limit {
            return Err(Error::Device(format!(
                "reading back {bytes} bytes at once; the largest buffer of this adapter has {limit} (max_buffer_size)"
            )));
        }
        let raw = gpu.scoped("reading back", || {
            let raw = gpu.landing(bytes);
            let mut at = 0;
            for (buffer, (_, copied)) in buffers.iter().zip(&parts) {
                encoder.copy_buffer_to_buffer(buffer.raw(), 0, &raw, at, *copied);
                at += copied;
            }
            raw
        })?;
        Ok(Self { raw, parts })
    }

    /// Waits for the copy, which must be submitted, and shows what came.
    pub(crate) fn look<T: Pod, R>(self, gpu: &Gpu, look: impl FnOnce(&[Cow<'_, [T]>]) -> R) -> Result<R> {
        let whole = self.parts.iter().map(|(_, copied)| copied).sum();
        gpu.map(&self.raw, wgpu::MapMode::Read, 0..whole)?;
        let shown = self.raw.get_mapped_range(0..whole).map(|view| {
            let mut at = 0;
            let cut = |(bytes, copied): &(u64, u64)| {
                let part = &view[at..at + *bytes as usize];
                at += *copied as usize;
                // A driver may map at any address.
                bytemuck::try_cast_slice(part).map_or_else(|_| bytemuck::pod_collect_to_vec(part).into(), Into::into)
            };
            let parts: Vec<Cow<'_, [T]>> = self.parts.iter().map(cut).collect();
            look(&parts)
        });
        self.raw.unmap();
        gpu.give_back(self.raw);
        shown.map_err(|e| Error::Device(format!("reading back: {e}")))
    }
}
