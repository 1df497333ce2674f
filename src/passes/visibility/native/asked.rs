//! Shadow rays of some samples only: those that are asked for, packed densely across receivers.
//!
//! A run of receivers that lie close together asks for few samples each. The shaft from the box of their origins to the
//! light is taken through the trees once; what it can reach are the portals that all packets of the run start from. A
//! packet takes rays of neighbours, in the order of the samples: it is narrow at both ends, and has a shaft of its own.
use super::super::trace_native::{Receiver, SampleTable, TraceScene};
use super::packet::Scratch;
use super::portal;
use super::rays::{Bundle, LANES, Row};
use super::scene::Group;
use super::shadow::{Columns, facing, through_portals};
use super::shaft::Interval;
use super::simd::{Isa, Lanes, Mask, set_lanes, splat3, three};

/// Receivers that share portals: a tile.
pub(crate) const RUN: usize = 64;
/// Receivers whose samples are taken together, sample after sample: a quad.
const GROUP: usize = 4;

/// Rays of a packet while it is filled.
struct Packet {
    bundle: Bundle,
    target: [Row; 3],
    /// Bit of the answers that each lane is for.
    bit: [u32; LANES],
    count: usize,
}

/// What a run knows of itself.
struct Run<'a> {
    columns: &'a Columns,
    receivers: &'a [Receiver],
    /// Words a receiver.
    words: usize,
}

/// Lanes whose rays can hit something, by the rules of the trace.
#[inline(always)]
fn usable<P: Lanes>(origin: [f32; 3], d: [P; 3], t_max: P) -> u32 {
    let (zero, huge) = (P::splat(0.0), P::splat(f32::MAX));
    let size = three!(i => d[i].abs());
    let finite = size[0].le(huge).and(size[1].le(huge)).and(size[2].le(huge));
    let ahead = zero.lt(size[0].max(size[1]).max(size[2])).and(zero.lt(t_max));
    let start = origin[0].is_finite() && origin[1].is_finite() && origin[2].is_finite();
    if start { finite.and(ahead).bits() } else { 0 }
}

/// Samples of one word that are asked, split into those to trace and those that stay as they are.
#[inline(always)]
fn sort_word<I: Isa>(
    table: &SampleTable,
    columns: &Columns,
    receiver: &Receiver,
    first: usize,
    asked: u32,
) -> [u32; 2] {
    let n = I::Packet::N;
    let (geo, shade) = (splat3(receiver.normal_geo), splat3(receiver.normal_shade));
    let from: [I::Packet; 3] = splat3(receiver.origin);
    let (mut trace, mut keep) = (0, 0);
    for shift in (0..32).step_by(n) {
        let part = (asked >> shift) & (u32::MAX >> (32 - n));
        if part == 0 {
            continue;
        }
        let d = three!(i => I::Packet::load(&columns.values[i][first + shift..]) - from[i]);
        let faces = part & facing::<I::Packet>(table, d, geo, shade);
        let t_max = I::Packet::load(&columns.values[3][first + shift..]);
        keep |= (part & !faces) << shift;
        trace |= (faces & usable(receiver.origin, d, t_max)) << shift;
    }
    [trace, keep]
}

/// Takes the asked bits apart: `bits` keeps what needs no ray, `todo` gets the rays. Returns how many they are, and
/// the box of their origins.
#[inline(always)]
fn sort<I: Isa>(run: &Run, table: &SampleTable, bits: &mut [u32], todo: &mut [u32]) -> (u64, Interval) {
    let (mut rays, mut origins) = (0, Interval::EMPTY);
    for (index, receiver) in run.receivers.iter().enumerate() {
        let mut own = 0;
        for word in 0..run.words {
            let at = index * run.words + word;
            let used = run.columns.strata - 32 * word;
            let asked = bits[at] & if used < 32 { (1 << used) - 1 } else { u32::MAX };
            [todo[at], bits[at]] = match run.columns.start(receiver) {
                Some(start) if asked != 0 => sort_word::<I>(table, run.columns, receiver, start + 32 * word, asked),
                _ => [0, 0],
            };
            own += u64::from(todo[at].count_ones());
        }
        if own > 0 {
            rays += own;
            origins = origins.union(&Interval::point(receiver.origin));
        }
    }
    (rays, origins)
}

/// Smallest and largest of the first `N` values of a row.
#[inline(always)]
fn ends<I: Isa>(row: &Row) -> [f32; 2] {
    let n = I::Node::N;
    let (mut lo, mut hi) = (I::Node::load(&row.0), I::Node::load(&row.0));
    for first in (n..I::Packet::N).step_by(n) {
        let part = I::Node::load(&row.0[first..]);
        (lo, hi) = (lo.min(part), hi.max(part));
    }
    let (mut least, mut most) = ([0.0; 8], [0.0; 8]);
    lo.store(&mut least);
    hi.store(&mut most);
    let [mut smallest, mut largest] = [least[0], most[0]];
    for i in 1..8 {
        (smallest, largest) = (smallest.min(least[i]), largest.max(most[i]));
    }
    [smallest, largest]
}

#[inline(always)]
fn box_of<I: Isa>(rows: &[Row; 3]) -> Interval {
    let ends = three!(i => ends::<I>(&rows[i]));
    Interval { lo: three!(i => ends[i][0]), hi: three!(i => ends[i][1]) }
}

/// Traces what the packet holds, and answers.
#[inline(always)]
fn flush<I: Isa>(scene: &TraceScene, packet: &mut Packet, t_max: f32, bits: &mut [u32], scratch: &mut Scratch) {
    let count = std::mem::take(&mut packet.count);
    if count == 0 {
        return;
    }
    // Idle lanes repeat the first ray, so that they do not widen the boxes.
    for row in packet.bundle.origin.iter_mut().chain(&mut packet.target) {
        let first = row.0[0];
        row.0[count..].fill(first);
    }
    let bundle = &mut packet.bundle;
    for axis in 0..3 {
        let (origin, target): (I::Packet, I::Packet) = (bundle.origin[axis].get(), packet.target[axis].get());
        (target - origin).store(&mut bundle.direction[axis].0);
    }
    bundle.active = ((1_u64 << count) - 1) as u32;
    let group = Group { origin: box_of::<I>(&bundle.origin), target: box_of::<I>(&packet.target), t_max };
    let portals = std::mem::take(&mut scratch.portals);
    for lane in set_lanes(through_portals::<I>(scene, bundle, group, &portals, scratch)) {
        let bit = packet.bit[lane] as usize;
        bits[bit / 32] |= 1 << (bit % 32);
    }
    scratch.portals = portals;
}

/// Traces the rays of `todo` and adds the bits of those that nothing stops.
#[inline(always)]
fn trace<I: Isa>(scene: &TraceScene, run: &Run, todo: &[u32], bits: &mut [u32], scratch: &mut Scratch) {
    let mut packet = Packet { bundle: Bundle::IDLE, target: [Row([0.0; LANES]); 3], bit: [0; LANES], count: 0 };
    for first in (0..run.receivers.len()).step_by(GROUP) {
        let group = first..(first + GROUP).min(run.receivers.len());
        for word in 0..run.words {
            for index in group.clone() {
                let at = index * run.words + word;
                if todo[at] == 0 {
                    continue;
                }
                let receiver = &run.receivers[index];
                let Some(start) = run.columns.start(receiver) else { continue };
                for k in set_lanes(todo[at]) {
                    let (lane, sample) = (packet.count, start + 32 * word + k);
                    for axis in 0..3 {
                        packet.bundle.origin[axis].0[lane] = receiver.origin[axis];
                        packet.target[axis].0[lane] = run.columns.values[axis][sample];
                    }
                    packet.bundle.t_max.0[lane] = run.columns.values[3][sample];
                    packet.bit[lane] = (32 * at + k) as u32;
                    packet.count += 1;
                    if packet.count == I::Packet::N {
                        flush::<I>(scene, &mut packet, run.columns.t_max, bits, scratch);
                    }
                }
            }
        }
    }
    flush::<I>(scene, &mut packet, run.columns.t_max, bits, scratch);
}

/// A list of receivers, see [`TraceScene::shadow_asked`]; returns the number of rays traced.
#[inline(always)]
pub(crate) fn shadow_asked<I: Isa>(
    scene: &TraceScene,
    receivers: &[Receiver],
    table: &SampleTable,
    columns: &Columns,
    bits: &mut [u32],
    scratch: &mut Scratch,
) -> u64 {
    let words = table.words();
    let mut todo = std::mem::take(&mut scratch.todo);
    todo.resize(RUN * words, 0);
    let mut rays = 0;
    for (receivers, bits) in receivers.chunks(RUN).zip(bits.chunks_mut(RUN * words)) {
        let run = Run { columns, receivers, words };
        let (own, origin) = sort::<I>(&run, table, bits, &mut todo);
        rays += own;
        if own == 0 {
            continue;
        }
        let mut portals = std::mem::take(&mut scratch.portals);
        portal::open::<I>(scene, &Group { origin, target: columns.all, t_max: columns.t_max }, &mut portals);
        scratch.portals = portals;
        if scratch.portals.is_empty() {
            bits.iter_mut().zip(&todo).for_each(|(bits, todo)| *bits |= todo);
        } else {
            trace::<I>(scene, &run, &todo, bits, scratch);
        }
    }
    scratch.todo = todo;
    rays
}
