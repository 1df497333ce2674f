//! Irradiance from a cut through the tree of virtual lights, one for each receiver.

use bytemuck::{Pod, Zeroable};

use super::forms;
use super::parts::{self, AT_ONCE, Parts};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::virtual_light::{Rsm, Tree, VirtualLights};
use crate::passes::lights::vpl_clusters;
use crate::passes::visibility::Receiver;
use crate::settings::Settings;

/// What a receiver's cut costs at first guess, nanoseconds: where the CPU draws, and elsewhere.
const CUT_NS: [f64; 2] = [20_000.0, 200.0];
/// Threads of a receiver where there are more of them than receivers.
const LANES: usize = 16;
/// Nodes that a thread visits at most; twin of `MOST_VISITS` in `shaders/common/light_cut.wgsl`.
const MOST_VISITS: usize = 40_000;
/// Thresholds below which a cut may come to more.
const EVERYTHING: f32 = 1e-4;
/// Level that irradiance is estimated at, where the coarsest in use is not coarser.
const REFERENCE: u32 = 3;

/// Twin of `CutParams` in `shaders/common/light_cut.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct CutParams {
    /// End of the nodes of the coarsest level in use.
    pub roots: u32,
    /// Coarsest level in use.
    pub coarsest: u32,
    /// Finest level in use.
    pub finest: u32,
    /// Maps of the tree.
    pub maps: u32,
    /// 0 paper, 1 contribution, 2 error.
    pub bound: u32,
    /// What a node may contribute, or its error be.
    pub threshold: f32,
    /// Of a virtual light.
    pub reach: f32,
    /// Of a receiver.
    pub rays: u32,
    /// The user's seed.
    pub seed: u32,
    /// Texels along an edge of a map.
    pub maps_size: u32,
    /// Level that irradiance is estimated at.
    pub reference: u32,
    /// Of this part.
    pub first_root: u32,
    /// Number of the part.
    pub part: u32,
    /// Parts of the coarsest level.
    pub parts: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// How far a virtual light reaches.
pub fn reach(settings: &Settings) -> f32 {
    settings.float("vpl_radius").map_or(3.0e38, |radius| radius as f32)
}

impl CutParams {
    /// Of a tree, as the settings say.
    pub fn of_tree(settings: &Settings, rsm: &Rsm) -> Self {
        // No cluster crosses the tiles of any map.
        let tiles = rsm.maps.iter().map(|map| map.tiles).max().unwrap_or(1);
        let [wanted, most] = ["coarsest_vpls", "vpls"].map(|name| settings.int(name));
        let (coarsest, finest) = vpl_clusters::levels(wanted, most, rsm.finest(), tiles).into_inner();
        let maps = rsm.maps.len() as u32;
        let bound = ["paper", "contribution", "error"].iter().position(|b| settings.is("light_cut_bound", b));
        Self {
            roots: maps << (2 * coarsest),
            coarsest,
            finest,
            maps,
            bound: bound.unwrap_or(0) as u32,
            threshold: settings.float("light_cut_threshold").unwrap_or(0.0) as f32,
            reference: coarsest.min(REFERENCE),
            ..Self::of_any(settings, rsm)
        }
    }

    /// Of a list: a tree of one level.
    pub fn of_list(settings: &Settings, rsm: &Rsm, lights: &VirtualLights) -> Self {
        Self { roots: lights.count as u32, maps: 1, ..Self::of_any(settings, rsm) }
    }

    /// One for each part.
    pub fn each(self) -> impl Iterator<Item = Self> {
        let below = ((1_usize << (2 * (self.finest - self.coarsest + 1))) - 1) / 3;
        // A list has nothing below it: its parts are those that it was summed up in.
        let deep = self.finest > self.coarsest && self.threshold < EVERYTHING;
        let ranges = parts::ranges_of(self.roots as usize, if deep { MOST_VISITS / below } else { AT_ONCE });
        let parts = ranges.clone().count() as u32;
        ranges.enumerate().map(move |(part, range)| Self {
            first_root: range.start as u32,
            roots: range.end as u32,
            part: part as u32,
            parts,
            ..self
        })
    }

    fn of_any(settings: &Settings, rsm: &Rsm) -> Self {
        Self {
            reach: reach(settings),
            rays: settings.int("indirect_rays"),
            seed: settings.int("seed"),
            maps_size: rsm.resolution,
            parts: 1,
            ..Self::zeroed()
        }
    }
}

/// Threads of a receiver. Of a software adapter one: it waits long at barriers.
pub fn lanes(context: &Context<'_, '_>) -> usize {
    if context.recorder.gpu().software() { 1 } else { LANES }
}

/// Irradiance of `count` receivers at the places that their `pixel` says; nodes that were evaluated are added to
/// `evaluations`: the lowest byte of each receiver's number to the first word, the rest of it to the second. Returns what
/// each thread of a receiver, or each part of the coarsest level, has of the irradiance.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(
    context: &mut Context<'_, '_>,
    (receivers, count): (&Buffer<Receiver>, usize),
    rsm: &Rsm,
    tree: &Tree,
    irradiance: &Buffer<[f32; 4]>,
    evaluations: &Buffer<u32>,
) -> Result<Parts> {
    let params = CutParams::of_tree(context.settings, rsm);
    let [form, mixed] = forms(context.settings);
    let lanes = lanes(context);
    let entry = if lanes > 1 { "wide" } else { "main" };
    let kernel = context.kernel_with("indirect/light_cut", entry, &[form, mixed, ("LANES", lanes as f64)])?;
    let all = if lanes > 1 { vec![params] } else { params.each().collect() };
    let parts = Parts::of_count(context, count, lanes.max(all.len()))?;
    for params in all {
        let pass = context.recorder.pass("light_cut", &kernel).uniform("params", &params);
        let pass = pass.bind("receivers", receivers).bind("maps", &rsm.table).bind("parts", &parts.values);
        let pass = pass.bind("virtual_lights", &tree.nodes).bind("ranges", &tree.ranges);
        let pass = pass.bind("irradiance", irradiance).bind("evaluations", evaluations);
        pass.dispatch_cut(count * lanes, CUT_NS[usize::from(lanes > 1)] / lanes as f64)?;
    }
    Ok(parts)
}
