//! Buffers to host memory: several at once with one wait, or lent in place where memory is shared.

use std::any::Any;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut, Range};
use std::sync::mpsc;

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::gpu::context::Gpu;
use crate::gpu::resource::Buffer;

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
        self.wait()?;
        if landed.try_iter().filter(|&ok| ok).count() == parts.len() {
            return Ok(());
        }
        Err(Error::Device("a buffer could not be mapped: is it lent twice?".to_string()))
    }

    /// Reads a whole buffer; waits for the work submitted before.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn read<T: Pod + Send>(&self, buffer: &Buffer<T>) -> Result<Vec<T>> {
        let mut readback = self.readback();
        let ticket = readback.add(buffer, 0..buffer.len())?;
        let mut landed = readback.wait()?;
        Ok(landed.take(ticket))
    }

    /// Starts to collect buffers that are read together.
    pub fn readback(&self) -> Readback<'_> {
        Readback { gpu: self, parts: Vec::new(), bytes: 0 }
    }

    /// Lends elements of a buffer to host code: in place on a software adapter, else as a copy.
    /// No work that uses the buffer may be submitted meanwhile.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn view<T: Pod + Send>(&self, buffer: &Buffer<T>, range: Range<usize>) -> Result<View<T>> {
        buffer.check_range(&range)?;
        if !buffer.mappable() || range.is_empty() {
            let mut readback = self.readback();
            let ticket = readback.add(buffer, range)?;
            return Ok(View(Lent::Copied(readback.wait()?.take(ticket))));
        }
        Ok(View(Lent::Mapped(Mapping::new(self, buffer, range, wgpu::MapMode::Read)?)))
    }

    /// Lends elements of a buffer to host code that overwrites them all; [`ViewMut::commit`] makes them visible.
    /// No work that uses the buffer may be submitted meanwhile.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn view_mut<T: Pod + Send>(&self, buffer: &Buffer<T>, range: Range<usize>) -> Result<ViewMut<T>> {
        buffer.check_range(&range)?;
        let lent = if buffer.mappable() && !range.is_empty() {
            Lent::Mapped(Mapping::new(self, buffer, range.clone(), wgpu::MapMode::Write)?)
        } else {
            Lent::Copied(vec![T::zeroed(); range.len()])
        };
        Ok(ViewMut { lent, buffer: buffer.clone(), first: range.start })
    }
}

/// Elements of a mapped buffer; unmapped when dropped.
struct Mapping<T> {
    raw: wgpu::Buffer,
    data: *mut T,
    len: usize,
    // Kept until the unmapping, which panics while one of them is alive.
    views: (Option<wgpu::BufferView>, Option<wgpu::BufferViewMut>),
}

// SAFETY: the pointer refers to memory that the views keep mapped, and is reached through `&self`/`&mut self` only.
unsafe impl<T: Send> Send for Mapping<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Mapping<T> {}

impl<T: Pod> Mapping<T> {
    fn new(gpu: &Gpu, buffer: &Buffer<T>, range: Range<usize>, mode: wgpu::MapMode) -> Result<Self> {
        let size = size_of::<T>() as u64;
        let (start, end) = (range.start as u64 * size, range.end as u64 * size);
        let Range { start: from, end: to } = widen(&(start..end));
        let raw = buffer.raw().clone();
        gpu.map(&raw, mode, from..to)?;
        let mut mapping = Self { raw, data: std::ptr::null_mut(), len: range.len(), views: (None, None) };
        let fault = |e: wgpu::MapRangeError| Error::Device(format!("{buffer:?}: {e}"));
        let base = match mode {
            wgpu::MapMode::Read => {
                let view = mapping.raw.get_mapped_range(from..to).map_err(fault)?;
                let base = view.as_ptr().cast_mut();
                mapping.views.0 = Some(view);
                base
            }
            wgpu::MapMode::Write => {
                let mut view = mapping.raw.get_mapped_range_mut(from..to).map_err(fault)?;
                let base = view.slice(..).as_raw_element_ptr().as_ptr();
                mapping.views.1 = Some(view);
                base
            }
        };
        mapping.data = base.wrapping_add((start - from) as usize).cast();
        if !mapping.data.is_aligned() {
            return Err(Error::Device(format!("{buffer:?}: the driver mapped it at an odd address")));
        }
        Ok(mapping)
    }
}

impl<T> Drop for Mapping<T> {
    fn drop(&mut self) {
        self.views = (None, None);
        self.raw.unmap();
    }
}

enum Lent<T> {
    Mapped(Mapping<T>),
    Copied(Vec<T>),
}

/// Read access to elements of a buffer.
pub struct View<T>(Lent<T>);

impl<T: Pod> Deref for View<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.0 {
            // SAFETY: mapped for reading, aligned and of this length, until the mapping is dropped.
            Lent::Mapped(m) => unsafe { std::slice::from_raw_parts(m.data, m.len) },
            Lent::Copied(data) => data,
        }
    }
}

/// Write access to elements of a buffer. What it holds at first is not defined; without [`ViewMut::commit`] the
/// contents of the buffer are not defined either.
pub struct ViewMut<T> {
    lent: Lent<T>,
    buffer: Buffer<T>,
    first: usize,
}

impl<T: Pod> ViewMut<T> {
    /// Makes what was written visible to work that is submitted later.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn commit(self, gpu: &Gpu) -> Result<()> {
        match self.lent {
            Lent::Mapped(mapping) => gpu.scoped("unmapping a buffer", || drop(mapping)),
            Lent::Copied(data) => self.buffer.write(gpu, self.first, &data),
        }
    }
}

impl<T: Pod> Deref for ViewMut<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.lent {
            // SAFETY: mapped, aligned and of this length; shared-memory mappings can be read as well.
            Lent::Mapped(m) => unsafe { std::slice::from_raw_parts(m.data, m.len) },
            Lent::Copied(data) => data,
        }
    }
}

impl<T: Pod> DerefMut for ViewMut<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        match &mut self.lent {
            // SAFETY: mapped for writing, aligned and of this length, borrowed once.
            Lent::Mapped(m) => unsafe { std::slice::from_raw_parts_mut(m.data, m.len) },
            Lent::Copied(data) => data,
        }
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
        let staging = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: bytes,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
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
fn widen(bytes: &Range<u64>) -> Range<u64> {
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
