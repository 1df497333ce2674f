//! Choice of the instruction set, and the split of the work over the cores.
use super::super::trace_native::{Hit, Ray, Receiver, SampleTable, SimdWidth, TraceScene};
use super::asked;
use super::packet::Scratch;
use super::prove::{self, Job};
use super::rays::Bundle;
use super::scene::trace;
use super::shadow::{self, Columns};
use super::simd::{Isa, Lanes, set_lanes};
use super::simd_portable::Portable;
#[cfg(target_arch = "x86_64")]
use super::simd_x86::{Avx2, Avx512};
use crate::scene::bvh::Child;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Rays of a piece of work: a multiple of 32, so that pieces share no word of bits.
const CHUNK: usize = 4096;

/// Instruction sets of this CPU, slowest first.
pub(crate) fn available() -> Vec<SimdWidth> {
    #[cfg_attr(not(target_arch = "x86_64"), expect(unused_mut, reason = "other CPUs have one form"))]
    let mut found = vec![SimdWidth::Portable];
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
    {
        found.push(SimdWidth::Avx2);
        if is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
        {
            found.push(SimdWidth::Avx512);
        }
    }
    found
}

/// Rays of a packet.
fn packet_lanes(width: SimdWidth) -> usize {
    match width {
        #[cfg(target_arch = "x86_64")]
        SimdWidth::Avx512 => <Avx512 as Isa>::Packet::N,
        #[cfg(target_arch = "x86_64")]
        SimdWidth::Avx2 => <Avx2 as Isa>::Packet::N,
        _ => <Portable as Isa>::Packet::N,
    }
}

/// The widest of them.
pub(crate) fn best() -> SimdWidth {
    available().pop().unwrap_or(SimdWidth::Portable)
}

#[inline(always)]
fn closest_rays<I: Isa>(scene: &TraceScene, rays: &[Ray], hits: &mut [Hit], scratch: &mut Scratch) {
    let n = I::Packet::N;
    let mut bundle = Bundle::IDLE;
    for (rays, hits) in rays.chunks(n).zip(hits.chunks_mut(n)) {
        bundle.fill::<I::Packet>(rays);
        let state = trace::<I, false>(scene, &mut bundle, scratch);
        for (lane, hit) in hits.iter_mut().enumerate() {
            let (instance, triangle) = (state.instance[lane], state.triangle[lane]);
            *hit = Hit::MISS;
            if instance != u32::MAX {
                let (t, u, v) = (state.t.0[lane], state.weight1.0[lane], state.weight2.0[lane]);
                *hit = Hit { t, u, v, instance, triangle };
            }
        }
    }
}

#[inline(always)]
fn any_rays<I: Isa>(scene: &TraceScene, rays: &[Ray], bits: &mut [u32], scratch: &mut Scratch) {
    let n = I::Packet::N;
    let mut bundle = Bundle::IDLE;
    bits.fill(0);
    for (packet, rays) in rays.chunks(n).enumerate() {
        bundle.fill::<I::Packet>(rays);
        let alive = trace::<I, true>(scene, &mut bundle, scratch).alive;
        for lane in set_lanes(bundle.active & !alive) {
            let ray = packet * n + lane;
            bits[ray / 32] |= 1 << (ray % 32);
        }
    }
}

/// Entry points that enable an instruction set for everything inlined into them.
macro_rules! entry {
    ($module:ident, $isa:ty, $features:literal) => {
        mod $module {
            use super::*;
            #[target_feature(enable = $features)]
            pub(super) fn closest(scene: &TraceScene, rays: &[Ray], hits: &mut [Hit], scratch: &mut Scratch) {
                closest_rays::<$isa>(scene, rays, hits, scratch);
            }
            #[target_feature(enable = $features)]
            pub(super) fn prove(scene: &TraceScene, job: &Job, first: usize, flags: &mut [u32], todo: &mut Vec<Child>) {
                prove::prove::<$isa>(scene, job, first, flags, todo);
            }
            #[target_feature(enable = $features)]
            pub(super) fn any(scene: &TraceScene, rays: &[Ray], bits: &mut [u32], scratch: &mut Scratch) {
                any_rays::<$isa>(scene, rays, bits, scratch);
            }
            #[target_feature(enable = $features)]
            pub(super) fn shadow(
                scene: &TraceScene,
                receivers: &[Receiver],
                table: &SampleTable,
                columns: &Columns,
                bits: &mut [u32],
                scratch: &mut Scratch,
            ) -> u64 {
                shadow::shadow::<$isa>(scene, receivers, table, columns, bits, scratch)
            }
            #[target_feature(enable = $features)]
            pub(super) fn shadow_asked(
                scene: &TraceScene,
                receivers: &[Receiver],
                table: &SampleTable,
                columns: &Columns,
                bits: &mut [u32],
                scratch: &mut Scratch,
            ) -> u64 {
                asked::shadow_asked::<$isa>(scene, receivers, table, columns, bits, scratch)
            }
        }
    };
}
#[cfg(target_arch = "x86_64")]
entry!(avx512, Avx512, "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,bmi2,lzcnt,popcnt");
#[cfg(target_arch = "x86_64")]
entry!(avx2, Avx2, "avx2,fma,bmi1,bmi2,lzcnt,popcnt");

/// Calls the entry point of the scene's instruction set.
macro_rules! run {
    ($scene:expr, $entry:ident, $portable:expr, ($($argument:expr),*)) => {
        match $scene.width {
            // SAFETY: `TraceScene` only holds a width that `available` has found.
            #[cfg(target_arch = "x86_64")]
            SimdWidth::Avx512 => unsafe { avx512::$entry($($argument),*) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            SimdWidth::Avx2 => unsafe { avx2::$entry($($argument),*) },
            _ => $portable($($argument),*),
        }
    };
}

fn scratch(scene: &TraceScene) -> Scratch {
    let depth = scene.placed.iter().map(|p| p.blas.depth_wide()).max().unwrap_or(0);
    Scratch::new(scene.tlas.depth(), depth)
}

/// See [`TraceScene::closest`].
pub(crate) fn closest(scene: &TraceScene, rays: &[Ray], hits: &mut [Hit], cancel: &AtomicBool) {
    let chunks = rays.par_chunks(CHUNK).zip(hits.par_chunks_mut(CHUNK));
    chunks.for_each_init(
        || scratch(scene),
        |scratch, (rays, hits)| {
            if !cancel.load(Ordering::Relaxed) {
                run!(scene, closest, closest_rays::<Portable>, (scene, rays, hits, scratch));
            }
        },
    );
}

/// See [`TraceScene::any`].
pub(crate) fn any(scene: &TraceScene, rays: &[Ray], bits: &mut [u32], cancel: &AtomicBool) {
    let chunks = rays.par_chunks(CHUNK).zip(bits.par_chunks_mut(CHUNK / 32));
    chunks.for_each_init(
        || scratch(scene),
        |scratch, (rays, bits)| {
            if !cancel.load(Ordering::Relaxed) {
                run!(scene, any, any_rays::<Portable>, (scene, rays, bits, scratch));
            }
        },
    );
}

/// See [`TraceScene::shadow`].
pub(crate) fn shadow(
    scene: &TraceScene,
    receivers: &[Receiver],
    table: &SampleTable,
    bits: &mut [u32],
    cancel: &AtomicBool,
) -> u64 {
    let columns = Columns::new(table, packet_lanes(scene.width));
    let run_length = (CHUNK / columns.strata).max(1);
    let chunks = receivers.par_chunks(run_length).zip(bits.par_chunks_mut(run_length * table.words()));
    let traced = chunks.map_init(
        || scratch(scene),
        |scratch, (receivers, bits)| {
            if cancel.load(Ordering::Relaxed) {
                return 0;
            }
            run!(scene, shadow, shadow::shadow::<Portable>, (scene, receivers, table, &columns, bits, scratch))
        },
    );
    traced.sum()
}

/// See [`TraceScene::shadow_asked`].
pub(crate) fn shadow_asked(
    scene: &TraceScene,
    receivers: &[Receiver],
    table: &SampleTable,
    bits: &mut [u32],
    cancel: &AtomicBool,
) -> u64 {
    let columns = Columns::new(table, packet_lanes(scene.width));
    let chunks = receivers.par_chunks(asked::RUN).zip(bits.par_chunks_mut(asked::RUN * table.words()));
    let traced = chunks.map_init(
        || scratch(scene),
        |scratch, (receivers, bits)| {
            if cancel.load(Ordering::Relaxed) {
                return 0;
            }
            run!(
                scene,
                shadow_asked,
                asked::shadow_asked::<Portable>,
                (scene, receivers, table, &columns, bits, scratch)
            )
        },
    );
    traced.sum()
}

/// Tiles of a piece of work.
const TILES: usize = 16;

/// See [`TraceScene::prove`].
pub(crate) fn prove(scene: &TraceScene, job: &Job, first: usize, flags: &mut [u32], cancel: &AtomicBool) {
    flags.par_chunks_mut(TILES).enumerate().for_each_init(Vec::new, |todo, (chunk, flags)| {
        if !cancel.load(Ordering::Relaxed) {
            let first = first + chunk * TILES;
            run!(scene, prove, prove::prove::<Portable>, (scene, job, first, flags, todo));
        }
    });
}
