//! Shadow rays of receivers against `any` on the same rays, ray by ray in float64, and in every SIMD width.
mod trace_common;
use glam::{Affine3A, Vec3};
use miplight::passes::visibility::trace_native::{Ray, Receiver, SampleTable, SimdWidth, TraceScene};
use std::sync::atomic::AtomicBool;
use trace_common::{Object, Random, brute_force, cube, instances, places, soup, sphere};

static GO: AtomicBool = AtomicBool::new(false);

struct Case {
    objects: Vec<Object>,
    receivers: Vec<Receiver>,
    points: Vec<[f32; 4]>,
    strata: u32,
}

fn case(strata: u32, count: usize, seed: u64) -> Case {
    let mut random = Random::new(seed);
    let mut objects = Vec::new();
    for (i, place) in places(&mut random).into_iter().enumerate() {
        let mesh = if i % 2 == 0 { soup(30, 0.5, &mut random) } else { sphere(2, 0.1) };
        objects.push(Object { mesh, place });
    }
    objects.push(Object { mesh: cube(1), place: Affine3A::from_scale(Vec3::splat(5.0)) });
    let side = (strata as f32).sqrt().ceil() as u32;
    let patterns = 5;
    let mut points = Vec::new();
    for i in 0..patterns * strata {
        let (k, cell) = (i % strata, 2.0 / side as f32);
        let (x, z) = ((k % side) as f32 + random.unit(), (k / side) as f32 + random.unit());
        points.push([x * cell - 1.0, 4.5, z * cell - 1.0, 0.999]);
    }
    let receiver = |i: usize| {
        let normal: [f32; 3] = if i.is_multiple_of(3) { Vec3::Y.into() } else { random.direction().into() };
        let shade = (Vec3::from(normal) + random.cube(0.2)).normalize();
        let pattern = if i % 17 == 5 { u32::MAX } else { i as u32 % patterns };
        let pattern = if i % 41 == 7 { patterns } else { pattern };
        Receiver {
            origin: random.cube(4.0).into(),
            pattern,
            normal_geo: normal,
            flags: 0,
            normal_shade: shade.into(),
            pixel: i as u32,
        }
    };
    let receivers = (0..count).map(receiver).collect();
    Case { objects, receivers, points, strata }
}

fn table(case: &Case, cone: bool, two_sided: bool) -> SampleTable<'_> {
    SampleTable {
        points: &case.points,
        strata: case.strata,
        light_normal: [0.0, -1.0, 0.0],
        two_sided,
        cone_axis: [0.0, -1.0, 0.0],
        cos_cutoff: if cone { 0.5 } else { -2.0 },
    }
}

/// Rays that the contract asks for, each with its bit; `None`: not to be decided in f32.
fn expected(case: &Case, table: &SampleTable) -> Vec<(usize, Ray, Option<bool>)> {
    let mut rays = Vec::new();
    for (index, r) in case.receivers.iter().enumerate() {
        if r.pattern as usize >= case.points.len() / case.strata as usize {
            continue;
        }
        for k in 0..case.strata as usize {
            let p = case.points[r.pattern as usize * case.strata as usize + k];
            let d = Vec3::new(p[0], p[1], p[2]) - Vec3::from(r.origin);
            let along = |v: [f32; 3]| Vec3::from(v).as_dvec3().dot(d.as_dvec3().normalize());
            let mut tests = vec![along(r.normal_geo), along(r.normal_shade)];
            if !table.two_sided {
                tests.push(-along(table.light_normal));
            }
            if table.cos_cutoff > -1.0 {
                tests.push(-along(table.cone_axis) - f64::from(table.cos_cutoff));
            }
            let slack = tests.into_iter().fold(f64::INFINITY, f64::min);
            let ray = Ray { origin: r.origin, t_min: 0.0, direction: d.into(), t_max: p[3] };
            rays.push((index * table.words() * 32 + k, ray, (slack.abs() > 1e-5).then_some(slack > 0.0)));
        }
    }
    rays
}

fn shadow(case: &Case, table: &SampleTable, width: SimdWidth) -> (Vec<u32>, u64) {
    let scene = TraceScene::new(instances(&case.objects)).with_width(width).expect("available");
    let mut bits = vec![u32::MAX; case.receivers.len() * table.words()];
    let rays = scene.shadow(&case.receivers, table, &mut bits, &GO);
    (bits, rays)
}

/// Differences between the bits and (`any`, brute force), and the number of rays that should have been traced.
fn differences(case: &Case, table: &SampleTable, bits: &[u32]) -> (usize, usize, u64) {
    let rays = expected(case, table);
    let scene = TraceScene::new(instances(&case.objects));
    let list: Vec<Ray> = rays.iter().map(|r| r.1).collect();
    let mut occluded = vec![0; list.len().div_ceil(32)];
    scene.any(&list, &mut occluded, &GO);
    let (mut from_any, mut from_brute, mut traced) = (0, 0, 0);
    for (i, (bit, ray, faces)) in rays.iter().enumerate() {
        let Some(faces) = *faces else { continue };
        traced += u64::from(faces);
        let seen = bits[bit / 32] >> (bit % 32) & 1 == 1;
        from_any += usize::from(seen != (faces && occluded[i / 32] >> (i % 32) & 1 == 0));
        if i % 7 == 0 {
            let reference = brute_force(&case.objects, ray);
            let clear = reference.instance == u32::MAX;
            from_brute += usize::from(seen != (faces && clear) && reference.margin > 1e-3);
        }
    }
    (from_any, from_brute, traced)
}

#[test]
fn shadow_bits_match_any_and_a_float64_brute_force() {
    for (strata, count) in [(1, 900), (4, 300), (9, 200), (16, 200), (25, 100), (64, 90), (256, 40), (300, 40)] {
        for (cone, two_sided) in [(false, false), (true, true)] {
            let case = case(strata, count, u64::from(strata));
            let table = table(&case, cone, two_sided);
            let (first, rays) = shadow(&case, &table, SimdWidth::Portable);
            let (from_any, from_brute, traced) = differences(&case, &table, &first);
            assert_eq!((from_any, from_brute), (0, 0), "{strata} strata");
            assert!(rays.abs_diff(traced) <= 4, "{strata} strata: {rays} rays, {traced} expected");
            for width in SimdWidth::available() {
                assert_eq!(shadow(&case, &table, width), (first.clone(), rays), "{strata} strata, {width:?}");
            }
            let lit: u32 = first.iter().map(|w| w.count_ones()).sum();
            assert!(u64::from(lit) > rays / 20 && u64::from(lit) < rays, "{lit} of {rays} lit");
        }
    }
}

#[test]
fn bundles_in_deep_trees_match_any() {
    // `any` knows no shafts and no portals: this is their test.
    let mut case = case(256, 150, 11);
    let mut random = Random::new(12);
    for place in places(&mut random) {
        case.objects.push(Object { mesh: sphere(5, 0.1), place });
    }
    case.objects.push(Object { mesh: soup(40_000, 0.01, &mut random), place: Affine3A::from_scale(Vec3::splat(4.0)) });
    let table = table(&case, false, true);
    let scene = TraceScene::new(instances(&case.objects));
    let rays = expected(&case, &table);
    let list: Vec<Ray> = rays.iter().map(|r| r.1).collect();
    let mut occluded = vec![0; list.len().div_ceil(32)];
    scene.any(&list, &mut occluded, &GO);
    let seen = |bits: &[u32]| rays.iter().filter(|r| bits[r.0 / 32] >> (r.0 % 32) & 1 == 1).count();
    for width in SimdWidth::available() {
        let (bits, traced) = shadow(&case, &table, width);
        let differs = |&(i, r): &(usize, &(usize, Ray, Option<bool>))| {
            let free = occluded[i / 32] >> (i % 32) & 1 == 0;
            r.2.is_some_and(|faces| (bits[r.0 / 32] >> (r.0 % 32) & 1 == 1) != (faces && free))
        };
        assert_eq!(rays.iter().enumerate().filter(differs).count(), 0, "{width:?}");
        assert!(seen(&bits) as u64 > traced / 20 && (seen(&bits) as u64) < traced * 19 / 20, "{width:?}");
    }
}

#[test]
fn a_disturbed_case_shows() {
    let case = case(16, 200, 9);
    let table = table(&case, false, false);
    let (bits, _) = shadow(&case, &table, SimdWidth::Portable);
    let mut other = Case { receivers: case.receivers.clone(), points: case.points.clone(), ..self::case(16, 0, 9) };
    other.receivers.iter_mut().for_each(|r| r.origin[0] += 0.05);
    let (from_any, from_brute, _) = differences(&other, &table, &bits);
    assert!(from_any > 20 && from_brute > 3, "{from_any} {from_brute}");
    let one_sided = SampleTable { light_normal: [0.0, 1.0, 0.0], ..table };
    assert!(differences(&case, &one_sided, &bits).0 > 100);
}

#[test]
fn nothing_to_do_is_fine() {
    let case = case(4, 10, 3);
    let scene = TraceScene::new(instances(&case.objects));
    let full = table(&case, false, false);
    assert_eq!(scene.shadow(&[], &full, &mut [], &GO), 0);
    let none = SampleTable { points: &[], strata: 0, ..full };
    assert_eq!(scene.shadow(&case.receivers, &none, &mut [], &GO), 0);
    let empty = SampleTable { points: &[], ..full };
    let mut bits = vec![u32::MAX; case.receivers.len()];
    assert_eq!(scene.shadow(&case.receivers, &empty, &mut bits, &GO), 0);
    assert!(bits.iter().all(|&w| w == 0));
    // Without an occluder all that faces is lit.
    let alone = TraceScene::new(Vec::new());
    let rays = alone.shadow(&case.receivers, &full, &mut bits, &GO);
    assert_eq!(u64::from(bits.iter().map(|w| w.count_ones()).sum::<u32>()), rays);
    assert!(rays > 5);
}
