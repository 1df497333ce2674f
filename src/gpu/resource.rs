//! Labelled, typed buffers and the pool that reuses them between frames.

use std::any::type_name;
use std::collections::HashMap;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::gpu::context::Gpu;

/// What a buffer is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Usage {
    /// Read and written by shaders; copied from and to.
    Storage,
    /// Storage that may also hold the arguments of an indirect dispatch.
    Indirect,
    /// Small constants of a shader that outlive a frame; [`crate::gpu::Pass::uniform`] is simpler for others.
    Uniform,
}

impl Usage {
    fn flags(self, mappable: bool) -> wgpu::BufferUsages {
        use wgpu::BufferUsages as U;
        let copies = U::COPY_SRC | U::COPY_DST;
        // On a software adapter a buffer is plain memory: the host may look at it without a copy.
        let lent = if mappable { U::MAP_READ | U::MAP_WRITE } else { U::empty() };
        match self {
            Usage::Storage => U::STORAGE | copies | lent,
            Usage::Indirect => U::STORAGE | U::INDIRECT | copies | lent,
            Usage::Uniform => U::UNIFORM | copies,
        }
    }
}

/// Counts the bytes of one allocation while it is alive.
struct Counted {
    bytes: u64,
    total: Arc<AtomicU64>,
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.total.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// One allocation, without a type.
#[derive(Clone)]
struct Allocation {
    raw: wgpu::Buffer,
    usage: Usage,
    counted: Arc<Counted>,
}

impl Allocation {
    fn new(gpu: &Gpu, label: &str, bytes: u64, usage: Usage) -> Result<Self> {
        let limit = gpu.limits().max_buffer_size;
        if bytes > limit {
            return Err(Error::Device(format!(
                "buffer {label:?} needs {bytes} bytes; the largest buffer of this adapter has {limit} (max_buffer_size)"
            )));
        }
        let flags = usage.flags(gpu.mappable());
        let raw = gpu.scoped(&format!("buffer {label:?} of {bytes} bytes"), || {
            gpu.device().create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage: flags,
                mapped_at_creation: false,
            })
        })?;
        let total = gpu.shared().allocated.clone();
        total.fetch_add(bytes, Ordering::Relaxed);
        Ok(Self { raw, usage, counted: Arc::new(Counted { bytes, total }) })
    }
}

/// Size of `len` elements as allocated and bound: never empty, a multiple of 16 so that any element can be copied.
fn bytes_of<T>(len: usize) -> u64 {
    let bytes = (len.max(1) as u64).saturating_mul(size_of::<T>() as u64);
    bytes.checked_next_multiple_of(16).unwrap_or(u64::MAX)
}

/// A GPU buffer of `len` elements of `T`. Cloning shares it.
#[derive(Clone)]
pub struct Buffer<T> {
    allocation: Allocation,
    label: Arc<str>,
    len: usize,
    element: PhantomData<fn() -> T>,
}

impl<T> std::fmt::Debug for Buffer<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Buffer<{}>({:?}, {})", type_name::<T>(), self.label, self.len)
    }
}

impl<T: Pod> Buffer<T> {
    /// Number of elements.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True when it has no element (16 bytes are allocated and bound all the same).
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Name that errors and captures show.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// The wgpu buffer.
    pub fn raw(&self) -> &wgpu::Buffer {
        &self.allocation.raw
    }

    /// True when host code may look at it without a copy.
    pub(crate) fn mappable(&self) -> bool {
        self.allocation.raw.usage().contains(wgpu::BufferUsages::MAP_READ)
    }

    /// Part of the buffer, for a binding. Its start must lie on the adapter's offset alignment (at most 256 bytes).
    ///
    /// # Errors
    /// [`Error::Device`] when it is out of bounds, empty or not aligned.
    pub fn range(&self, gpu: &Gpu, range: Range<usize>) -> Result<Slice<'_>> {
        self.check_range(&range)?;
        let size = size_of::<T>() as u64;
        let offset = range.start as u64 * size;
        let align = u64::from(gpu.limits().min_storage_buffer_offset_alignment);
        if range.is_empty() || !offset.is_multiple_of(align) {
            return Err(Error::Device(format!(
                "{self:?}: elements {range:?} cannot be bound: a range starts at a multiple of {align} bytes and is not empty"
            )));
        }
        let bytes = (range.len() as u64 * size).next_multiple_of(4);
        Ok(Slice { offset, bytes, ..self.into() })
    }

    /// Writes `data` from element `first` on; it takes effect before any work that is submitted later.
    ///
    /// # Errors
    /// [`Error::Device`] when it does not fit or the device fails.
    pub fn write(&self, gpu: &Gpu, first: usize, data: &[T]) -> Result<()> {
        self.check_range(&(first..first.saturating_add(data.len())))?;
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let offset = (first * size_of::<T>()) as u64;
        if bytes.is_empty() {
            return Ok(());
        }
        if !offset.is_multiple_of(4) || !bytes.len().is_multiple_of(4) {
            return Err(Error::Device(format!("{self:?}: a write starts and ends at multiples of 4 bytes")));
        }
        gpu.scoped(&format!("writing {self:?}"), || gpu.queue().write_buffer(&self.allocation.raw, offset, bytes))
    }

    pub(crate) fn check_range(&self, range: &Range<usize>) -> Result<()> {
        if range.start > range.end || range.end > self.len {
            return Err(Error::Device(format!("{self:?}: elements {range:?} are out of bounds")));
        }
        Ok(())
    }
}

/// Bytes of a buffer as bound to a shader.
#[derive(Debug, Clone, Copy)]
pub struct Slice<'a> {
    pub(crate) raw: &'a wgpu::Buffer,
    pub(crate) label: &'a str,
    pub(crate) usage: Usage,
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
    pub(crate) element_bytes: u64,
}

impl<'a, T: Pod> From<&'a Buffer<T>> for Slice<'a> {
    fn from(buffer: &'a Buffer<T>) -> Self {
        let exact = (buffer.len.max(1) * size_of::<T>()) as u64;
        Self {
            raw: &buffer.allocation.raw,
            label: &buffer.label,
            usage: buffer.allocation.usage,
            offset: 0,
            bytes: exact.next_multiple_of(4),
            element_bytes: size_of::<T>() as u64,
        }
    }
}

impl Gpu {
    /// A new buffer of zeros.
    ///
    /// # Errors
    /// [`Error::Device`] above `max_buffer_size` or without memory.
    pub fn buffer<T: Pod>(&self, label: &str, len: usize, usage: Usage) -> Result<Buffer<T>> {
        let allocation = Allocation::new(self, label, bytes_of::<T>(len), usage)?;
        Ok(Buffer { allocation, label: label.into(), len, element: PhantomData })
    }

    /// A new storage buffer that holds `data`.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn upload<T: Pod>(&self, label: &str, data: &[T]) -> Result<Buffer<T>> {
        let buffer = self.buffer(label, data.len(), Usage::Storage)?;
        buffer.write(self, 0, data)?;
        Ok(buffer)
    }
}

/// Buffers by name, kept from frame to frame. A buffer only ever grows; what it holds at first is what the last
/// frame left there.
pub struct Resources {
    gpu: Gpu,
    kept: HashMap<String, Allocation>,
}

impl Resources {
    /// An empty pool.
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.clone(), kept: HashMap::new() }
    }

    /// The storage buffer `name` with `len` elements of `T`; allocated when it is new or too small.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn buffer<T: Pod>(&mut self, name: &str, len: usize) -> Result<Buffer<T>> {
        self.buffer_for(name, len, Usage::Storage)
    }

    /// As [`Resources::buffer`], for another usage.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn buffer_for<T: Pod>(&mut self, name: &str, len: usize, usage: Usage) -> Result<Buffer<T>> {
        let bytes = bytes_of::<T>(len);
        let fits = |kept: &Allocation| kept.usage == usage && kept.raw.size() >= bytes;
        let allocation = match self.kept.get(name) {
            Some(kept) if fits(kept) => kept.clone(),
            _ => {
                // Free the old one first: both may not fit.
                self.kept.remove(name);
                let made = Allocation::new(&self.gpu, name, bytes, usage)?;
                self.kept.insert(name.to_string(), made.clone());
                made
            }
        };
        Ok(Buffer { allocation, label: name.into(), len, element: PhantomData })
    }

    /// As [`Resources::buffer`], with room to spare when it is made anew; then the old one is returned as well, whose
    /// elements the new one lacks.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn grow<T: Pod>(&mut self, name: &str, len: usize) -> Result<(Buffer<T>, Option<Buffer<T>>)> {
        let usage = Usage::Storage;
        let old =
            self.kept.get(name).filter(|kept| kept.usage == usage && kept.raw.size() < bytes_of::<T>(len)).cloned();
        let Some(allocation) = old else {
            return Ok((self.buffer(name, len)?, None));
        };
        let held = allocation.raw.size() as usize / size_of::<T>();
        let old = Buffer { allocation, label: name.into(), len: held, element: PhantomData };
        self.buffer::<T>(name, len + len / 2)?;
        Ok((self.buffer(name, len)?, Some(old)))
    }

    /// Takes a buffer out of the pool, so that the next frame makes a new one and the holder keeps this one's contents.
    pub fn release(&mut self, name: &str) {
        self.kept.remove(name);
    }

    /// Names in the pool, sorted.
    pub fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.kept.keys().map(String::as_str).collect();
        names.sort_unstable();
        names
    }

    /// Bytes that the pool holds.
    pub fn bytes(&self) -> u64 {
        self.kept.values().map(|kept| kept.counted.bytes).sum()
    }
}
