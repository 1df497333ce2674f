//! Shadow rays of receivers towards the samples of one light.
use super::super::trace_native::{Receiver, SampleTable, TraceScene};
use super::packet::{Portals, Scratch, State};
use super::portal;
use super::rays::{Bundle, Heading, LANES, Row, rows};
use super::scene::{Group, Launch, trace, visit};
use super::shaft::Interval;
use super::simd::{Isa, Lanes, Mask, set_lanes, splat3, three};

/// A sample table as columns, so that neighbouring strata load as vectors, and their boxes.
pub(crate) struct Columns {
    /// x, y, z and the largest `t`, each with 16 spare values at the end.
    pub(super) values: [Vec<f32>; 4],
    pub(crate) strata: usize,
    /// Box of each pattern.
    patterns: Vec<Interval>,
    /// Box of each packet of each pattern.
    packets: Vec<Interval>,
    packets_each: usize,
    /// Largest end of a ray.
    pub(super) t_max: f32,
    /// Box of all patterns.
    pub(super) all: Interval,
}

/// Box of points; everywhere when one is NaN.
fn box_of(points: &[[f32; 4]]) -> Interval {
    let mut b = Interval::EMPTY;
    for p in points {
        b.lo = three!(i => b.lo[i].min(p[i]));
        b.hi = three!(i => b.hi[i].max(p[i]));
    }
    let nan = points.iter().any(|p| p[0].is_nan() || p[1].is_nan() || p[2].is_nan());
    if nan { Interval { lo: [f32::MIN; 3], hi: [f32::MAX; 3] } } else { b }
}

impl Columns {
    /// Turns the rows of a table into columns, for packets of `n`.
    pub(crate) fn new(table: &SampleTable, n: usize) -> Self {
        let column = |axis: usize| {
            let spare = std::iter::repeat_n(0.0, LANES);
            table.points.iter().map(|p| p[axis]).chain(spare).collect()
        };
        let strata = table.strata as usize;
        let patterns: Vec<Interval> = table.points.chunks(strata).map(box_of).collect();
        let packets = table.points.chunks(strata).flat_map(|pattern| pattern.chunks(n).map(box_of));
        Self {
            values: [0, 1, 2, 3].map(column),
            strata,
            all: patterns.iter().fold(Interval::EMPTY, |all, p| all.union(p)),
            patterns,
            packets: packets.collect(),
            packets_each: strata.div_ceil(n),
            t_max: table.points.iter().fold(0.0, |t, p| t.max(p[3])),
        }
    }

    /// Index of the first sample of a receiver; `None` when it is inactive.
    #[inline(always)]
    pub(super) fn start(&self, receiver: &Receiver) -> Option<usize> {
        let pattern = receiver.pattern as usize;
        (pattern < self.patterns.len()).then_some(pattern * self.strata)
    }
}

#[inline(always)]
fn dot<P: Lanes>(a: [P; 3], b: [P; 3]) -> P {
    a[2].fma(b[2], a[1].fma(b[1], a[0] * b[0]))
}

/// Lanes whose sample faces the surface and whose light emits towards it.
#[inline(always)]
pub(super) fn facing<P: Lanes>(table: &SampleTable, d: [P; 3], normal_geo: [P; 3], normal_shade: [P; 3]) -> u32 {
    let zero = P::splat(0.0);
    let mut mask = zero.lt(dot(normal_geo, d)).and(zero.lt(dot(normal_shade, d)));
    if !table.two_sided {
        mask = mask.and(dot(splat3(table.light_normal), d).lt(zero));
    }
    if table.cos_cutoff > -1.0 {
        let limit = P::splat(table.cos_cutoff) * dot(d, d).sqrt();
        mask = mask.and(limit.le(zero - dot(splat3(table.cone_axis), d)));
    }
    mask.bits()
}

/// All samples of one receiver, a packet at a time; returns the number of rays.
#[inline(always)]
fn receiver_rays<I: Isa>(
    scene: &TraceScene,
    table: &SampleTable,
    columns: &Columns,
    receiver: &Receiver,
    bits: &mut [u32],
    scratch: &mut Scratch,
) -> u64 {
    let Some(start) = columns.start(receiver) else { return 0 };
    let pattern = receiver.pattern as usize;
    let n = I::Packet::N;
    let (geo, shade) = (splat3(receiver.normal_geo), splat3(receiver.normal_shade));
    let mut bundle = Bundle { origin: receiver.origin.map(|x| Row([x; LANES])), ..Bundle::IDLE };
    let origin = Interval::point(receiver.origin);
    let mut portals = std::mem::take(&mut scratch.portals);
    let all = Group { origin, target: columns.patterns[pattern], t_max: columns.t_max };
    portal::open::<I>(scene, &all, &mut portals);
    let mut rays = 0;
    for (packet, first) in (0..columns.strata).step_by(n).enumerate() {
        for axis in 0..3 {
            let to = I::Packet::load(&columns.values[axis][start + first..]);
            (to - I::Packet::splat(receiver.origin[axis])).store(&mut bundle.direction[axis].0);
        }
        I::Packet::load(&columns.values[3][start + first..]).store(&mut bundle.t_max.0);
        let used = ((1u64 << n.min(columns.strata - first)) - 1) as u32;
        bundle.active = used & facing::<I::Packet>(table, rows(&bundle.direction), geo, shade);
        bundle.check::<I::Packet>();
        let mut visible = bundle.active;
        rays += u64::from(visible.count_ones());
        if visible != 0 && !portals.is_empty() {
            let target = columns.packets[pattern * columns.packets_each + packet];
            let group = Group { origin, target, t_max: columns.t_max };
            visible = through_portals::<I>(scene, &bundle, group, &portals, scratch);
        }
        bits[first / 32] |= visible << (first % 32);
    }
    scratch.portals = portals;
    rays
}

/// Rays of a packet that nothing behind the portals stops.
#[inline(always)]
pub(super) fn through_portals<I: Isa>(
    scene: &TraceScene,
    bundle: &Bundle,
    group: Group,
    portals: &Portals,
    scratch: &mut Scratch,
) -> u32 {
    let mut state = State::new(bundle.t_min, bundle.t_max, bundle.active);
    let heading = Heading::new::<I::Packet>(&bundle.direction);
    let launch = Launch { bundle, heading, group: Some(group) };
    let mut first = 0;
    for &(instance, end) in &portals.instances {
        let mask = state.alive;
        if mask == 0 {
            break;
        }
        let (placed, roots) = (&scene.placed[instance as usize], &portals.nodes[first..end]);
        visit::<I, true>(placed, instance as usize, roots, &launch, mask, &mut state, scratch);
        first = end;
    }
    state.alive
}

/// Few strata: a packet spans consecutive receivers; returns the number of rays.
#[inline(always)]
fn few_strata<I: Isa>(
    scene: &TraceScene,
    table: &SampleTable,
    columns: &Columns,
    receivers: &[Receiver],
    bits: &mut [u32],
    scratch: &mut Scratch,
) -> u64 {
    let (n, strata) = (I::Packet::N, columns.strata);
    let total = receivers.len() * strata;
    let zero = [Row([0.0; LANES]); 3];
    let (mut geo, mut shade) = (zero, zero);
    let mut bundle = Bundle::IDLE;
    let mut rays = 0;
    for first in (0..total).step_by(n) {
        let mut used = 0;
        for lane in 0..n.min(total - first) {
            let receiver = &receivers[(first + lane) / strata];
            let Some(start) = columns.start(receiver) else { continue };
            let sample = start + (first + lane) % strata;
            used |= 1 << lane;
            for axis in 0..3 {
                bundle.origin[axis].0[lane] = receiver.origin[axis];
                bundle.direction[axis].0[lane] = columns.values[axis][sample] - receiver.origin[axis];
                geo[axis].0[lane] = receiver.normal_geo[axis];
                shade[axis].0[lane] = receiver.normal_shade[axis];
            }
            bundle.t_max.0[lane] = columns.values[3][sample];
        }
        bundle.active = used & facing::<I::Packet>(table, rows(&bundle.direction), rows(&geo), rows(&shade));
        if bundle.active == 0 {
            continue;
        }
        rays += u64::from(bundle.active.count_ones());
        for lane in set_lanes(trace::<I, true>(scene, &mut bundle, scratch).alive) {
            let (receiver, stratum) = ((first + lane) / strata, (first + lane) % strata);
            bits[receiver * table.words() + stratum / 32] |= 1 << (stratum % 32);
        }
    }
    rays
}

/// A run of receivers; returns the number of rays traced.
#[inline(always)]
pub(crate) fn shadow<I: Isa>(
    scene: &TraceScene,
    receivers: &[Receiver],
    table: &SampleTable,
    columns: &Columns,
    bits: &mut [u32],
    scratch: &mut Scratch,
) -> u64 {
    bits.fill(0);
    if columns.strata < I::Packet::N {
        return few_strata::<I>(scene, table, columns, receivers, bits, scratch);
    }
    let words = table.words();
    let mut rays = 0;
    for (receiver, bits) in receivers.iter().zip(bits.chunks_mut(words)) {
        rays += receiver_rays::<I>(scene, table, columns, receiver, bits, scratch);
    }
    rays
}
