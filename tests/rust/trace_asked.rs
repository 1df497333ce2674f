//! Shadow rays of some samples only: the same bits as all samples give, in every SIMD width and however they are packed.
mod trace_common;
use glam::{Affine3A, Vec3};
use miplight::passes::visibility::trace_native::{Receiver, SampleTable, SimdWidth, TraceInstance, TraceScene};
use std::sync::atomic::AtomicBool;
use trace_common::{Object, Random, cube, instances, places, soup, sphere};

static GO: AtomicBool = AtomicBool::new(false);
const PATTERNS: u32 = 5;

/// A closed room that holds everything, tilted, so that its walls fill boxes; deep trees; every kind of transform.
fn scene(random: &mut Random) -> Vec<TraceInstance> {
    let mut objects = Vec::new();
    for (i, place) in places(random).into_iter().enumerate() {
        let mesh = match i % 3 {
            0 => soup(30, 0.5, random),
            1 => sphere(5, 0.1),
            _ => soup(20_000, 0.01, random),
        };
        objects.push(Object { mesh, place });
    }
    let tilt =
        Affine3A::from_axis_angle(Vec3::new(1.0, 2.0, 0.5).normalize(), 0.7) * Affine3A::from_scale(Vec3::splat(7.0));
    objects.push(Object { mesh: cube(1), place: tilt });
    instances(&objects)
}

/// Receivers in clusters of 64, from pixels of one tile to the whole scene, some inactive.
fn receivers(count: usize, random: &mut Random) -> Vec<Receiver> {
    let mut made = Vec::new();
    while made.len() < count {
        let (middle, spread) = (random.cube(3.5), [0.01, 0.1, 1.0, 3.0][made.len() / 64 % 4]);
        let normal = if made.len() % 128 == 0 { Vec3::Y } else { random.direction() };
        for i in made.len()..(made.len() + 64).min(count) {
            let pattern = if i % 17 == 5 { u32::MAX } else { i as u32 % (PATTERNS + u32::from(i % 41 == 7)) };
            made.push(Receiver {
                origin: (middle + random.cube(spread)).into(),
                pattern,
                normal_geo: normal.into(),
                flags: 0,
                normal_shade: (normal + random.cube(0.2)).normalize().into(),
                pixel: i as u32,
            });
        }
    }
    made
}

fn points(strata: u32, random: &mut Random) -> Vec<[f32; 4]> {
    let side = (strata as f32).sqrt().ceil() as u32;
    let point = |i: u32, random: &mut Random| {
        let (k, cell) = (i % strata, 2.0 / side as f32);
        let (x, z) = ((k % side) as f32 + random.unit(), (k / side) as f32 + random.unit());
        [x * cell - 1.0, 4.0, z * cell - 1.0, 0.999]
    };
    (0..PATTERNS * strata).map(|i| point(i, random)).collect()
}

fn table(points: &[[f32; 4]], strata: u32, cone: bool) -> SampleTable<'_> {
    SampleTable {
        points,
        strata,
        light_normal: [0.0, -1.0, 0.0],
        two_sided: cone,
        cone_axis: [0.0, -1.0, 0.0],
        cos_cutoff: if cone { 0.5 } else { -2.0 },
    }
}

/// Words of bits, each bit set with the chance of its receiver: none, one in 64, a quarter, all.
fn asks(receivers: usize, words: usize, random: &mut Random) -> Vec<u32> {
    let mut bit = |receiver: usize| match receiver / 64 % 4 {
        0 => random.unit() < 1.0 / 64.0,
        1 => random.unit() < 0.25,
        2 => random.unit() < 0.1 && receiver % 7 == 0,
        _ => true,
    };
    (0..receivers * words).map(|w| (0..32).fold(0, |word, k| word | u32::from(bit(w / words)) << k)).collect()
}

struct Expected {
    bits: Vec<u32>,
    rays: u64,
    hidden: u64,
}

/// What all samples say: a bit stays when the sample is seen, or does not face the receiver.
fn expected(scene: &TraceScene, receivers: &[Receiver], table: &SampleTable, asked: &[u32]) -> Expected {
    let (mut seen, mut faces) = (vec![0; asked.len()], vec![0; asked.len()]);
    scene.shadow(receivers, table, &mut seen, &GO);
    TraceScene::new(Vec::new()).shadow(receivers, table, &mut faces, &GO);
    let words = table.words();
    let used = |at: usize| {
        let left = table.strata - 32 * (at % words) as u32;
        let active = receivers[at / words].pattern < PATTERNS;
        if !active { 0 } else { u32::MAX >> (32 - left.min(32)) }
    };
    let count = |f: &dyn Fn(usize) -> u32| (0..asked.len()).map(|at| u64::from(f(at).count_ones())).sum();
    Expected {
        bits: (0..asked.len()).map(|at| asked[at] & used(at) & (seen[at] | !faces[at])).collect(),
        rays: count(&|at| asked[at] & faces[at]),
        hidden: count(&|at| asked[at] & faces[at] & !seen[at]),
    }
}

#[test]
fn asked_bits_are_those_of_all_samples() {
    let mut random = Random::new(3);
    let mut scene = TraceScene::new(scene(&mut random));
    let (mut rays, mut hidden) = (0, 0);
    for (strata, count) in [(1, 700), (4, 300), (16, 500), (33, 300), (64, 600), (256, 520), (300, 70)] {
        let points = points(strata, &mut random);
        let receivers = receivers(count, &mut random);
        for cone in [false, true] {
            let table = table(&points, strata, cone);
            let asked = asks(count, table.words(), &mut random);
            let right = expected(&scene, &receivers, &table, &asked);
            (rays, hidden) = (rays + right.rays, hidden + right.hidden);
            for width in SimdWidth::available() {
                scene = scene.with_width(width).expect("available");
                let mut bits = asked.clone();
                let traced = scene.shadow_asked(&receivers, &table, &mut bits, &GO);
                assert_eq!(traced, right.rays, "{strata} strata, {width:?}");
                assert!(bits == right.bits, "{strata} strata, {width:?}");
            }
        }
    }
    assert!(hidden > rays / 10 && hidden < rays * 9 / 10, "{hidden} of {rays} hidden");
}

#[test]
fn a_shifted_scene_shows() {
    // Negative control: the comparison sees occluders that are out of place.
    let mut random = Random::new(4);
    let instances = scene(&mut random);
    let points = points(64, &mut random);
    let (receivers, table) = (receivers(600, &mut random), table(&points, 64, true));
    let asked = asks(600, table.words(), &mut random);
    let right = expected(&TraceScene::new(instances.clone()), &receivers, &table, &asked);
    let shift = Affine3A::from_translation(Vec3::new(0.1, 0.0, 0.0));
    let moved = instances.into_iter().map(|i| TraceInstance::new(shift * i.scene_from_object, i.blas)).collect();
    let mut bits = asked;
    TraceScene::new(moved).shadow_asked(&receivers, &table, &mut bits, &GO);
    let differ: u32 = bits.iter().zip(&right.bits).map(|(a, b)| (a ^ b).count_ones()).sum();
    assert!(differ > 100, "{differ}");
}

#[test]
fn unusual_lists_are_fine() {
    let mut random = Random::new(5);
    let scene = TraceScene::new(scene(&mut random));
    let points = points(40, &mut random);
    let full = table(&points, 40, true);
    assert_eq!(scene.shadow_asked(&[], &full, &mut [], &GO), 0);
    let receivers = receivers(100, &mut random);
    assert_eq!(scene.shadow_asked(&receivers, &SampleTable { points: &[], strata: 0, ..full }, &mut [], &GO), 0);
    let mut bits = vec![u32::MAX; 200];
    assert_eq!(scene.shadow_asked(&receivers, &SampleTable { points: &[], ..full }, &mut bits, &GO), 0);
    assert!(bits.iter().all(|&word| word == 0), "no pattern, no bit");
    // A sample that faces and can not be traced gets no bit, as in `shadow`.
    let faulty: Vec<[f32; 4]> = points.iter().map(|p| [p[0], p[1], p[2], 0.0]).collect();
    let mut bits = vec![u32::MAX; 200];
    let faces = expected(&scene, &receivers, &full, &bits).rays;
    let alone = TraceScene::new(Vec::new());
    assert_eq!(alone.shadow_asked(&receivers, &table(&faulty, 40, true), &mut bits, &GO), 0);
    let live = receivers.iter().filter(|r| r.pattern < PATTERNS).count() as u64;
    assert_eq!(bits.iter().map(|word| u64::from(word.count_ones())).sum::<u64>(), 40 * live - faces);
}
