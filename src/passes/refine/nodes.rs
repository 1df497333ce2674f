//! The nodes of a level: texels that incremental refinement looks at, and their shading points.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::{Buffer, Usage};
use crate::passes::refine::compact;
use crate::passes::refine::pyramid::Pyramid;
use crate::passes::visibility::Receiver;
use crate::passes::{Context, GBuffer};

/// Nodes of a level begin at a multiple of this, so that parts of the lists can be bound.
const ALIGN: usize = 64;
/// Pixels for each node that there is room for at first.
const SPARE: usize = 4;

/// Twin of `NodesParams` in `shaders/passes/refine/nodes.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct NodesParams {
    /// First node of this level.
    pub base: u32,
    /// First node of the level above.
    pub parents: u32,
    /// Sets of sample points.
    pub patterns: u32,
    /// Interleaved sets of samples: 1 or 4.
    pub classes: u32,
    /// The user's seed.
    pub seed: u32,
    /// 1: pixels use the sample points of the node above.
    pub inherit: u32,
    /// Unused.
    pub pad1: u32,
    /// Unused.
    pub pad2: u32,
}

/// The nodes of one level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Level {
    /// Which level.
    pub level: u32,
    /// Its first node.
    pub first: usize,
    /// How many nodes it has.
    pub count: usize,
}

/// The nodes of a frame, level after level; rows as in `shaders/common/nodes.wgsl`.
#[derive(Debug, Clone)]
pub struct Nodes {
    /// The levels of the image.
    pub pyramid: Pyramid,
    /// Texel, shading pixel, state, parent.
    pub rows: Buffer<[u32; 4]>,
    /// A texel: 1 + its node, or 0.
    pub at: Buffer<u32>,
    /// Shading points.
    pub receivers: Buffer<Receiver>,
    /// Irradiance of all lights.
    pub irradiance: Buffer<[f32; 4]>,
    /// From the coarsest level on.
    pub levels: Vec<Level>,
}

impl Nodes {
    /// None yet.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(context: &mut Context<'_, '_>, pyramid: Pyramid) -> Result<Self> {
        let room = context.view.pixels() / SPARE;
        let at = context.resources.buffer("node_at", pyramid.texels())?;
        context.recorder.clear(&at)?;
        Ok(Self {
            pyramid,
            rows: context.resources.buffer("node_rows", room)?,
            at,
            receivers: context.resources.buffer("node_receivers", room)?,
            irradiance: context.resources.buffer("node_irradiance", room)?,
            levels: Vec::new(),
        })
    }

    /// One past the last node.
    pub fn end(&self) -> usize {
        self.levels.last().map_or(0, |level| level.first + level.count)
    }

    /// Adds the nodes of `level`: all of the coarsest, else the children of what was split above.
    ///
    /// # Errors
    /// Those of the device.
    pub fn add(
        &mut self,
        context: &mut Context<'_, '_>,
        gbuffer: &GBuffer,
        state: &Buffer<u32>,
        mut params: NodesParams,
        level: u32,
    ) -> Result<Level> {
        let above = self.levels.last().copied();
        let (entry, items) = match above {
            None => ("roots", self.pyramid.levels[level as usize][3] as usize),
            Some(above) => ("children", 4 * above.count),
        };
        params.base = self.end().next_multiple_of(ALIGN) as u32;
        params.parents = above.map_or(0, |above| above.first as u32);
        let made = Level { level, first: params.base as usize, count: 0 };
        if items == 0 {
            self.levels.push(made);
            return Ok(made);
        }
        let flags: Buffer<u32> = context.resources.buffer("node_flags", items)?;
        let list: Buffer<u32> = context.resources.buffer("node_list", items)?;
        let arguments = context.resources.buffer_for("node_arguments", 4, Usage::Indirect)?;
        let kernel = context.kernel("refine/nodes", entry)?;
        let pyramid = self.pyramid.at(level);
        let pass = context.recorder.pass("nodes", &kernel).uniform("pyramid", &pyramid);
        let pass = match above {
            Some(_) => pass.uniform("params", &params).bind("node_rows", &self.rows),
            None => pass,
        };
        pass.bind("texel_state", state).bind("node_flags", &flags).dispatch(items)?;
        compact::record(context, "fragment_list", &flags, items, 1, 1, &list, &arguments)?;
        let count = context.recorder.fetch(&[&arguments])?[0][3] as usize;
        let made = Level { count, ..made };
        self.make_room(context, made.first + count)?;
        self.levels.push(made);
        if count > 0 {
            self.write(context, gbuffer, state, &params, &list, made)?;
        }
        Ok(made)
    }

    fn make_room(&mut self, context: &mut Context<'_, '_>, len: usize) -> Result<()> {
        let kept = self.end();
        self.rows = context.grown("node_rows", kept, len)?;
        self.receivers = context.grown("node_receivers", kept, len)?;
        self.irradiance = context.grown("node_irradiance", kept, len)?;
        Ok(())
    }

    fn write(
        &self,
        context: &mut Context<'_, '_>,
        gbuffer: &GBuffer,
        state: &Buffer<u32>,
        params: &NodesParams,
        list: &Buffer<u32>,
        level: Level,
    ) -> Result<()> {
        let kernel = context.kernel("refine/nodes", "main")?;
        let pyramid = self.pyramid.at(level.level);
        let pass = context.recorder.pass("nodes", &kernel).uniform("params", params).uniform("pyramid", &pyramid);
        let pass = pass.bind("texel_state", state).bind("node_list", list).bind("g_position", &gbuffer.position);
        let pass = pass.bind("g_normal", &gbuffer.normal).bind("g_geometric", &gbuffer.geometric);
        let pass = pass.bind("node_rows", &self.rows).bind("node_at", &self.at);
        pass.bind("node_receivers", &self.receivers).dispatch(level.count)
    }
}
