//! Buffers to host memory: several at once with one wait, or lent in place where memory is shared.

use std::any::Any;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::mpsc;
use std::time::Duration;

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::gpu::context::Gpu;
use crate::gpu::resource::Buffer;

/// Callbacks of a finished mapping come at once, or never.
const CALLBACK: Duration = Duration::from_secs(5);

impl Gpu {
    /// Maps bytes of a buffer and waits for it: the work submitted before is done then.
    pub(crate) fn map(&self, buffer: &wgpu::Buffer, mode: wgpu::MapMode, bytes: Range<u64>) -> Result<()> {
        self.map_all(&[(buffer, bytes)], mode)
    }

    fn map_all(&self, parts: &[(&wgpu::Buffer, Range<u64>)], mode: wgpu::MapMode) -> Result<()> {
        let (send, landed) = mpsc::channel();
        self.scoped("mapping buffers", || {
            for (buffer, bytes) in parts {
                let send = send.clone();
                buffer.map_async(mode, bytes.clone(), move |result| {
                    // The receiver is gone only when this function has failed already.
                    let _ = send.send(result.is_ok());
                });
            }
        })?;
        drop(send);
        self.wait()?;
        // Another thread that waits for this device may be the one that runs the callbacks, a moment later.
        if parts.iter().all(|_| landed.recv_timeout(CALLBACK).is_ok_and(|ok| ok)) {
            return Ok(());
        }
        Err(Error::Device("a buffer could not be mapped: is it lent twice?".to_string()))
    }

    /// Starts to collect buffers that are read together.
    pub fn readback(&self) -> Readback<'_> {
        Readback { gpu: self, parts: Vec::new(), bytes: 0 }
    }
}

/// One part of a readback, for [`Landed::take`].
pub struct Ticket<T>(usize, PhantomData<fn() -> T>);

struct Part {
    raw: wgpu::Buffer,
    source: u64,
    /// Place in the staging buffer, `None` when it is mapped where it lies.
    staged: Option<u64>,
    bytes: u64,
    decode: fn(&[u8]) -> Box<dyn Any + Send>,
}

fn decode<T: Pod + Send>(bytes: &[u8]) -> Box<dyn Any + Send> {
    Box::new(bytemuck::pod_collect_to_vec::<u8, T>(bytes))
}

/// Buffers that are read together with one wait.
pub struct Readback<'a> {
    gpu: &'a Gpu,
    parts: Vec<Part>,
    bytes: u64,
}

impl Readback<'_> {
    /// Adds elements of a buffer; a buffer is added once.
    ///
    /// # Errors
    /// [`Error::Device`] when the range is out of bounds or does not start at a multiple of 4 bytes.
    pub fn add<T: Pod + Send>(&mut self, buffer: &Buffer<T>, range: Range<usize>) -> Result<Ticket<T>> {
        buffer.check_range(&range)?;
        let size = size_of::<T>() as u64;
        let (source, bytes) = (range.start as u64 * size, range.len() as u64 * size);
        if !source.is_multiple_of(4) {
            return Err(Error::Device(format!("{buffer:?}: a readback starts at a multiple of 4 bytes")));
        }
        let staged = (!buffer.mappable()).then_some(self.bytes);
        if staged.is_some() {
            self.bytes += bytes.next_multiple_of(16);
        }
        self.parts.push(Part { raw: buffer.raw().clone(), source, staged, bytes, decode: decode::<T> });
        Ok(Ticket(self.parts.len() - 1, PhantomData))
    }

    /// Waits for the work submitted before and copies everything.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn wait(self) -> Result<Landed> {
        let Readback { gpu, parts, bytes } = self;
        let staging = if bytes > 0 { Some(stage(gpu, &parts, bytes)?) } else { None };
        // (buffer to map, byte range of the part in it)
        let places: Vec<_> = parts
            .iter()
            .map(|part| match (part.staged, &staging) {
                (Some(at), Some(staging)) => (staging, at..at + part.bytes),
                _ => (&part.raw, part.source..part.source + part.bytes),
            })
            .collect();
        let direct = parts.iter().zip(&places).filter(|(p, _)| p.staged.is_none() && p.bytes > 0);
        let mut mapped: Vec<_> = direct.map(|(_, (raw, range))| (*raw, widen(range))).collect();
        mapped.extend(staging.as_ref().map(|s| (s, 0..bytes)));
        gpu.map_all(&mapped, wgpu::MapMode::Read)?;
        let copied: Result<Vec<_>> =
            parts.iter().zip(&places).map(|(part, (raw, range))| copy_out(raw, range, part.decode).map(Some)).collect();
        mapped.iter().for_each(|(raw, _)| raw.unmap());
        if let Some(staging) = staging.clone() {
            gpu.give_back(staging);
        }
        Ok(Landed(copied?))
    }
}

fn stage(gpu: &Gpu, parts: &[Part], bytes: u64) -> Result<wgpu::Buffer> {
    let limit = gpu.limits().max_buffer_size;
    if bytes > limit {
        return Err(Error::Device(format!(
            "reading back {bytes} bytes at once; the largest buffer of this adapter has {limit} (max_buffer_size)"
        )));
    }
    gpu.scoped("reading back", || {
        let staging = gpu.landing(bytes);
        let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for part in parts.iter().filter(|p| p.bytes > 0) {
            if let Some(at) = part.staged {
                let bytes = part.bytes.next_multiple_of(4);
                encoder.copy_buffer_to_buffer(&part.raw, part.source, &staging, at, bytes);
            }
        }
        gpu.queue().submit([encoder.finish()]);
        staging
    })
}

/// Mapped ranges start at multiples of 8 and have a length that is one of 4; allocations are padded for that.
pub(crate) fn widen(bytes: &Range<u64>) -> Range<u64> {
    (bytes.start & !7)..bytes.end.next_multiple_of(4)
}

fn copy_out(
    mapped: &wgpu::Buffer,
    bytes: &Range<u64>,
    decode: fn(&[u8]) -> Box<dyn Any + Send>,
) -> Result<Box<dyn Any + Send>> {
    if bytes.is_empty() {
        return Ok(decode(&[]));
    }
    let wide = widen(bytes);
    let skip = (bytes.start - wide.start) as usize;
    let view = mapped.get_mapped_range(wide).map_err(|e| Error::Device(format!("reading back: {e}")))?;
    Ok(decode(&view[skip..skip + (bytes.end - bytes.start) as usize]))
}

/// What a readback brought.
pub struct Landed(Vec<Option<Box<dyn Any + Send>>>);

impl Landed {
    /// The elements of one part; empty when it was taken before.
    pub fn take<T: Pod + Send>(&mut self, ticket: Ticket<T>) -> Vec<T> {
        let part = self.0.get_mut(ticket.0).and_then(Option::take);
        part.and_then(|any| any.downcast().ok()).map(|data| *data).unwrap_or_default()
    }
}
