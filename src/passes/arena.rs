//! A growing device buffer that holds many small things by id, so that what did not change is not sent again.

use std::collections::{BTreeMap, BTreeSet};

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Usage};

/// Where a thing lies, in elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    first: usize,
    len: usize,
}

/// Things by id in one buffer.
#[derive(Debug)]
pub struct Arena<T> {
    label: &'static str,
    what: &'static str,
    buffer: Option<Buffer<T>>,
    places: BTreeMap<u64, Place>,
    used: usize,
}

impl<T: Pod> Arena<T> {
    /// An empty arena; `what` names its contents in errors.
    pub fn new(label: &'static str, what: &'static str) -> Self {
        Self { label, what, buffer: None, places: BTreeMap::new(), used: 0 }
    }

    /// Makes the arena hold exactly the things `wanted`; `fill` gives the elements of one that is not there yet.
    /// Returns whether anything was sent.
    ///
    /// # Errors
    /// `Device` when they do not fit into one binding.
    pub fn sync(&mut self, gpu: &Gpu, wanted: &[(u64, usize)], fill: impl Fn(u64) -> Vec<T>) -> Result<bool> {
        let ids: BTreeSet<u64> = wanted.iter().map(|(id, _)| *id).collect();
        let missing: Vec<(u64, usize)> =
            wanted.iter().filter(|(id, _)| !self.places.contains_key(id)).copied().collect();
        if missing.is_empty() && self.buffer.is_some() {
            return Ok(false);
        }
        self.places.retain(|id, _| ids.contains(id));
        let new: usize = missing.iter().map(|(_, len)| len).sum();
        let capacity = self.buffer.as_ref().map_or(0, Buffer::len);
        if self.buffer.is_none() || self.used + new > capacity {
            return self.repack(gpu, wanted, fill).map(|()| true);
        }
        for (id, len) in missing {
            self.put(gpu, id, len, &fill)?;
        }
        Ok(true)
    }

    fn put(&mut self, gpu: &Gpu, id: u64, len: usize, fill: &impl Fn(u64) -> Vec<T>) -> Result<()> {
        let place = Place { first: self.used, len };
        if let Some(buffer) = &self.buffer {
            buffer.write(gpu, place.first, &fill(id))?;
        }
        self.used += len;
        self.places.insert(id, place);
        Ok(())
    }

    /// A new buffer without holes, half as large again as what it holds, so that a mesh that changes every frame does
    /// not cause one every frame.
    fn repack(&mut self, gpu: &Gpu, wanted: &[(u64, usize)], fill: impl Fn(u64) -> Vec<T>) -> Result<()> {
        let total: usize = wanted.iter().map(|(_, len)| len).sum();
        let limit = gpu.limits().max_storage_buffer_binding_size as usize / size_of::<T>();
        if total > limit {
            return Err(Error::Device(format!(
                "{} need {} bytes in one binding; this adapter allows {} (max_storage_buffer_binding_size)",
                self.what,
                total * size_of::<T>(),
                limit * size_of::<T>()
            )));
        }
        self.places.clear();
        self.used = 0;
        self.buffer = None;
        let room = if total == 0 { 1 } else { (total + total / 2).min(limit) };
        self.buffer = Some(gpu.buffer(self.label, room, Usage::Storage)?);
        for &(id, len) in wanted {
            self.put(gpu, id, len, &fill)?;
        }
        Ok(())
    }

    /// First element of a thing that the last `sync` wanted.
    pub fn first(&self, id: u64) -> u32 {
        self.places.get(&id).map_or(0, |place| place.first as u32)
    }

    /// The buffer; there is one after the first `sync`.
    pub fn buffer(&self) -> Result<&Buffer<T>> {
        self.buffer.as_ref().ok_or_else(|| Error::Device(format!("{} were never sent", self.what)))
    }
}
