//! Shadow rays of receivers towards the samples of one light.
use super::super::trace_native::{Receiver, SampleTable, TraceScene};
use super::packet::Scratch;
use super::rays::{Bundle, Row, rows};
use super::scene::trace;
use super::simd::{Isa, Lanes, Mask, set_lanes, splat3};

/// A sample table as columns, so that neighbouring strata load as vectors.
pub(crate) struct Columns {
    /// x, y, z and the largest `t`, each with 16 spare values at the end.
    values: [Vec<f32>; 4],
    pub(crate) strata: usize,
    patterns: usize,
}

impl Columns {
    /// Turns the rows of a table into columns.
    pub(crate) fn new(table: &SampleTable) -> Self {
        let column = |axis: usize| {
            let spare = std::iter::repeat_n(0.0, 16);
            table.points.iter().map(|p| p[axis]).chain(spare).collect()
        };
        let strata = table.strata as usize;
        Self { values: [0, 1, 2, 3].map(column), strata, patterns: table.points.len() / strata }
    }

    /// Index of the first sample of a receiver; `None` when it is inactive.
    #[inline(always)]
    fn start(&self, receiver: &Receiver) -> Option<usize> {
        let pattern = receiver.pattern as usize;
        (pattern < self.patterns).then_some(pattern * self.strata)
    }
}

/// Shading points of the lanes of a packet.
struct Points {
    normal_geo: [Row; 3],
    normal_shade: [Row; 3],
}

#[inline(always)]
fn dot<P: Lanes>(a: [P; 3], b: [P; 3]) -> P {
    a[2].fma(b[2], a[1].fma(b[1], a[0] * b[0]))
}

/// Lanes whose sample faces the surface and whose light emits towards it.
#[inline(always)]
fn facing<P: Lanes>(table: &SampleTable, direction: &[Row; 3], points: &Points) -> u32 {
    let (d, zero) = (rows::<P>(direction), P::splat(0.0));
    let geo = zero.lt(dot(rows(&points.normal_geo), d));
    let mut mask = geo.and(zero.lt(dot(rows(&points.normal_shade), d)));
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
    let n = I::Packet::N;
    let splat = |v: [f32; 3]| v.map(|x| Row([x; 16]));
    let points = Points { normal_geo: splat(receiver.normal_geo), normal_shade: splat(receiver.normal_shade) };
    let mut bundle = Bundle { origin: splat(receiver.origin), ..Bundle::IDLE };
    let mut rays = 0;
    for first in (0..columns.strata).step_by(n) {
        for axis in 0..3 {
            let to = I::Packet::load(&columns.values[axis][start + first..]);
            (to - I::Packet::splat(receiver.origin[axis])).store(&mut bundle.direction[axis].0);
        }
        I::Packet::load(&columns.values[3][start + first..]).store(&mut bundle.t_max.0);
        let used = ((1u64 << n.min(columns.strata - first)) - 1) as u32;
        bundle.active = used & facing::<I::Packet>(table, &bundle.direction, &points);
        if bundle.active == 0 {
            continue;
        }
        rays += u64::from(bundle.active.count_ones());
        let visible = trace::<I, true>(scene, &mut bundle, scratch).alive;
        bits[first / 32] |= visible << (first % 32);
    }
    rays
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
    let zero = [Row([0.0; 16]); 3];
    let mut points = Points { normal_geo: zero, normal_shade: zero };
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
                points.normal_geo[axis].0[lane] = receiver.normal_geo[axis];
                points.normal_shade[axis].0[lane] = receiver.normal_shade[axis];
            }
            bundle.t_max.0[lane] = columns.values[3][sample];
        }
        bundle.active = used & facing::<I::Packet>(table, &bundle.direction, &points);
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
