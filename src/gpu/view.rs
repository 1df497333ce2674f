//! Buffers lent to host code: in place where memory is shared, else as a copy.

use std::ops::{Deref, DerefMut, Range};

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::gpu::context::Gpu;
use crate::gpu::readback::widen;
use crate::gpu::resource::Buffer;

impl Gpu {
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
