//! The WGSL form of `trace`: the same trees, transforms and rules as the native form, on the device.
//!
//! Meshes are sent once and stay; moving an instance sends the top level again, and nothing else.
use std::collections::BTreeMap;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::trace_native::{Hit, Ray, TraceScene};
use super::tree_upload::{self, MESH_LEVELS, TOP_LEVELS};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Pass, Recorder, Usage};
use crate::passes::arena::Arena;
use crate::scene::bvh::{Blas, Node2};

/// Twin of `Triangle` in `shaders/common/bvh.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct TriangleRecord {
    /// Corner 0.
    pub a: [f32; 3],
    /// Index in its mesh.
    pub id: u32,
    /// Corner 1.
    pub b: [f32; 3],
    /// Unused.
    pub pad_b: u32,
    /// Corner 2.
    pub c: [f32; 3],
    /// Unused.
    pub pad_c: u32,
}

/// Twin of `Placed` in `shaders/common/bvh.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PlacedRecord {
    /// Linear part of `object_from_scene`, first row.
    pub row_x: [f32; 3],
    /// Root of its mesh.
    pub node: u32,
    /// Second row.
    pub row_y: [f32; 3],
    /// First triangle of its mesh.
    pub triangle: u32,
    /// Third row.
    pub row_z: [f32; 3],
    /// Number that hits name.
    pub id: u32,
    /// The object's origin in scene space.
    pub center: [f32; 3],
    /// Largest coordinate in object space; below zero: the linear part is the identity.
    pub reach: f32,
}

/// Twin of `TopLevel` in `shaders/common/bvh.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct TopLevel {
    /// Nodes of the top level; 0: nothing to hit.
    pub nodes: u32,
}

/// First guess of the cost of a ray, nanoseconds; measured afterwards.
const SOFTWARE_NS: f64 = 500.0;
const DEVICE_NS: f64 = 5.0;

/// Lists are tiled at multiples of this, so that rays, hits and words of bits all start where they can be bound.
const TILE: usize = 2048;

/// The scene's trees on the device.
pub struct WgslTrace {
    nodes: Arena<Node2>,
    triangles: Arena<TriangleRecord>,
    top_nodes: Buffer<Node2>,
    instances: Buffer<PlacedRecord>,
    top_level: TopLevel,
    counter: Buffer<u32>,
    /// Before a kernel is measured.
    pub(super) ns_per_ray: f64,
}

/// Overwrites the start of `buffer`, or replaces it by one twice as large as needed.
fn overwrite<T: Pod>(gpu: &Gpu, buffer: &mut Buffer<T>, data: &[T]) -> Result<()> {
    if data.len() > buffer.len() {
        *buffer = gpu.buffer(buffer.label(), 2 * data.len(), Usage::Storage)?;
    }
    buffer.write(gpu, 0, data)
}

impl WgslTrace {
    /// Nothing to hit yet.
    ///
    /// # Errors
    /// `Device`.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            nodes: Arena::new("mesh_nodes", "the trees of all meshes"),
            triangles: Arena::new("triangles", "the triangles of all meshes"),
            top_nodes: gpu.buffer("top_nodes", 1, Usage::Storage)?,
            instances: gpu.buffer("instances", 1, Usage::Storage)?,
            top_level: TopLevel { nodes: 0 },
            counter: gpu.buffer("ray_counter", 2, Usage::Storage)?,
            ns_per_ray: if gpu.software() { SOFTWARE_NS } else { DEVICE_NS },
        })
    }

    /// Brings the device up to date; returns what was sent.
    ///
    /// # Errors
    /// `Device`: also when all meshes together do not fit into one binding.
    pub fn sync(&mut self, gpu: &Gpu, scene: &TraceScene) -> Result<Vec<&'static str>> {
        let used = scene.tlas.order().iter().map(|&i| &scene.placed[i as usize].blas);
        let meshes: BTreeMap<u64, &Blas> = used.map(|blas| (blas.id(), &**blas)).collect();
        let nodes: Vec<(u64, usize)> = meshes.iter().map(|(&id, blas)| (id, blas.nodes_bvh2().len())).collect();
        let triangles: Vec<(u64, usize)> = meshes.iter().map(|(&id, blas)| (id, blas.triangle_order().len())).collect();
        let mut sent = Vec::new();
        let new_nodes =
            self.nodes.sync(gpu, &nodes, |id| tree_upload::within(meshes[&id].nodes_bvh2(), MESH_LEVELS))?;
        let new_triangles = self.triangles.sync(gpu, &triangles, |id| tree_upload::triangles(meshes[&id]))?;
        if new_nodes || new_triangles {
            sent.push("meshes");
        }
        let top = tree_upload::within(scene.tlas.nodes_bvh2(), TOP_LEVELS);
        overwrite(gpu, &mut self.top_nodes, &top)?;
        let records = self.instance_records(scene);
        overwrite(gpu, &mut self.instances, &records)?;
        self.top_level = TopLevel { nodes: top.len() as u32 };
        sent.push("top level");
        Ok(sent)
    }

    fn instance_records(&self, scene: &TraceScene) -> Vec<PlacedRecord> {
        let record = |&id: &u32| {
            let placed = &scene.placed[id as usize];
            let mesh = placed.blas.id();
            let [row_x, row_y, row_z] = placed.rows;
            PlacedRecord {
                row_x,
                node: self.nodes.first(mesh),
                row_y,
                triangle: self.triangles.first(mesh),
                row_z,
                id,
                center: placed.center,
                reach: if placed.identity { -placed.reach } else { placed.reach },
            }
        };
        scene.tlas.order().iter().map(record).collect()
    }

    /// A pass with the trees and the counter bound.
    pub(super) fn pass<'r, 'a>(
        &'r self,
        recorder: &'r mut Recorder<'a>,
        stage: &str,
        kernel: &'r Kernel,
    ) -> Result<Pass<'r, 'a>> {
        Ok(self.trees(recorder, stage, kernel)?.bind("counter", &self.counter))
    }

    /// A pass with the trees bound.
    pub(super) fn trees<'r, 'a>(
        &'r self,
        recorder: &'r mut Recorder<'a>,
        stage: &str,
        kernel: &'r Kernel,
    ) -> Result<Pass<'r, 'a>> {
        Ok(recorder
            .pass(stage, kernel)
            .bind("top_nodes", &self.top_nodes)
            .bind("instances", &self.instances)
            .bind("mesh_nodes", self.nodes.buffer()?)
            .bind("triangles", self.triangles.buffer()?)
            .uniform("top_level", &self.top_level))
    }

    /// The first thing that each ray of `range` meets; `range` starts at a multiple of 2,048.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    pub fn closest(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        rays: &Buffer<Ray>,
        hits: &Buffer<Hit>,
        range: Range<usize>,
    ) -> Result<()> {
        let gpu = recorder.gpu().clone();
        let kernel = gpu.kernel("passes/visibility/trace", "closest", &[])?;
        for tile in tiles(&gpu, range) {
            self.pass(recorder, stage, &kernel)?
                .bind("rays", rays.range(&gpu, tile.clone())?)
                .bind("hits", hits.range(&gpu, tile.clone())?)
                .dispatch_cut(tile.len(), self.ns_per_ray)?;
        }
        Ok(())
    }

    /// Bit `i % 32` of word `i / 32` is set when ray `i` of `range` meets anything; `range` starts at a multiple of
    /// 2,048.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    pub fn any(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        rays: &Buffer<Ray>,
        occluded: &Buffer<u32>,
        range: Range<usize>,
    ) -> Result<()> {
        let gpu = recorder.gpu().clone();
        let kernel = gpu.kernel("passes/visibility/trace", "any_hit", &[])?;
        for tile in tiles(&gpu, range) {
            let words = tile.start / 32..tile.end.div_ceil(32);
            self.pass(recorder, stage, &kernel)?
                .bind("rays", rays.range(&gpu, tile.clone())?)
                .bind("occluded", occluded.range(&gpu, words)?)
                .dispatch_cut(tile.len(), self.ns_per_ray)?;
        }
        Ok(())
    }

    /// Rays traced since the last call; waits for the device.
    ///
    /// # Errors
    /// `Device`.
    pub fn take_rays(&self, gpu: &Gpu) -> Result<u64> {
        self.counted(gpu, &gpu.read(&self.counter)?)
    }

    pub(super) fn counter(&self) -> &Buffer<u32> {
        &self.counter
    }

    pub(super) fn counted(&self, gpu: &Gpu, words: &[u32]) -> Result<u64> {
        self.counter.write(gpu, 0, &[0, 0])?;
        Ok(u64::from(words[0]) | u64::from(words[1]) << 32)
    }
}

/// Parts of a list that fit into one binding each.
fn tiles(gpu: &Gpu, range: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let most = gpu.limits().max_storage_buffer_binding_size as usize / size_of::<Ray>();
    let len = (most / TILE * TILE).max(TILE);
    range.clone().step_by(len).map(move |first| first..(first + len).min(range.end))
}
