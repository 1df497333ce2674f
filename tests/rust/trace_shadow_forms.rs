//! The two forms of the trace give the same answers on shadow rays: of all samples, and of those that are asked for.
//!
//! Their arithmetic differs (see `trace_forms`), so answers may differ where a ray passes within rounding of an edge.
mod trace_common;

use glam::Vec3;
use miplight::gpu::{Gpu, never};
use miplight::passes::visibility::shadow::ShadowLight;
use miplight::passes::visibility::trace::{Form, Tracer};
use miplight::passes::visibility::trace_native::Receiver;
use std::ops::Range;
use std::sync::OnceLock;
use trace_common::{Object, Random, cube, instances, places, soup, sphere};

fn device() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| Gpu::new("auto").expect("these tests need an adapter; Mesa's llvmpipe will do"))
}

fn tracer(form: Form, objects: &[Object]) -> Tracer {
    let mut tracer = Tracer::with_form(device(), form).unwrap();
    tracer.set_scene(device(), instances(objects)).unwrap();
    tracer
}

fn objects(random: &mut Random) -> Vec<Object> {
    let mesh = |i: usize, random: &mut Random| match i % 3 {
        0 => soup(60, 0.4, random),
        1 => sphere(2, 0.1),
        _ => cube(3),
    };
    places(random).into_iter().enumerate().map(|(i, place)| Object { mesh: mesh(i, random), place }).collect()
}

fn receivers(count: usize, patterns: u32, random: &mut Random) -> Vec<Receiver> {
    (0..count)
        .map(|i| {
            let normal = if i % 3 == 0 { Vec3::Y } else { random.direction() };
            Receiver {
                origin: random.cube(3.0).into(),
                pattern: if i % 17 == 5 { u32::MAX } else { i as u32 % patterns },
                normal_geo: normal.into(),
                flags: 0,
                normal_shade: (normal + random.cube(0.2)).normalize().into(),
                pixel: i as u32,
            }
        })
        .collect()
}

/// Bits of all receivers, and the number of rays: of all samples, or of those that `asked` names, for the receivers of
/// `range`.
fn shadow_bits(
    tracer: &Tracer,
    receivers: &[Receiver],
    samples: (&[[f32; 4]], u32, bool),
    asked: Option<&[u32]>,
    range: Range<usize>,
) -> (Vec<u32>, u64) {
    let gpu = device();
    let (points, strata, cone) = samples;
    let list = gpu.upload("receivers", receivers).unwrap();
    let points = gpu.upload("points", points).unwrap();
    let light = ShadowLight {
        points: &points,
        strata,
        light_normal: [0.0, -1.0, 0.0],
        two_sided: cone,
        cone_axis: [0.0, -1.0, 0.0],
        cos_cutoff: if cone { 0.6 } else { -2.0 },
    };
    let all = vec![u32::MAX; receivers.len() * light.words()];
    let bits = gpu.upload("visibility", asked.unwrap_or(&all)).unwrap();
    let mut recorder = gpu.record(never()).unwrap();
    let mut rays = match asked {
        None => tracer.shadow(&mut recorder, "shadow", &list, &light, &bits, range).unwrap(),
        Some(_) => tracer.shadow_asked(&mut recorder, "shadow", &list, &light, &bits, range).unwrap(),
    };
    recorder.finish().unwrap();
    rays += tracer.device_rays(gpu).unwrap();
    (gpu.read(&bits).unwrap(), rays)
}

/// All samples of all receivers.
fn shadow(tracer: &Tracer, receivers: &[Receiver], points: &[[f32; 4]], strata: u32, cone: bool) -> (Vec<u32>, u64) {
    shadow_bits(tracer, receivers, (points, strata, cone), None, 0..receivers.len())
}

#[test]
fn asked_samples_get_the_bits_of_all_samples() {
    let mut random = Random::new(8);
    let objects = objects(&mut random);
    for form in [Form::Native, Form::Wgsl] {
        let (tracer, alone) = (tracer(form, &objects), tracer(form, &[]));
        for (strata, cone) in [(1, true), (16, true), (33, false), (256, true)] {
            let points: Vec<[f32; 4]> =
                (0..5 * strata).map(|_| [random.range(-1.0, 1.0), 4.5, random.range(-1.0, 1.0), 0.999]).collect();
            let receivers = receivers(400, 5, &mut random);
            let (seen, _) = shadow(&tracer, &receivers, &points, strata, cone);
            let (faces, _) = shadow(&alone, &receivers, &points, strata, cone);
            let asked: Vec<u32> = seen.iter().map(|_| random.bits() & random.bits()).collect();
            let words = seen.len() / receivers.len();
            let live = |at: usize| {
                let left = strata - 32 * (at % words) as u32;
                if receivers[at / words].pattern < 5 { u32::MAX >> (32 - left.min(32)) } else { 0 }
            };
            // The receivers before 64 and from 333 on are not of the range.
            let range = 64..333;
            let right = |at: usize| {
                let inside = range.contains(&(at / words));
                if inside { asked[at] & live(at) & (seen[at] | !faces[at]) } else { asked[at] }
            };
            let right: Vec<u32> = (0..asked.len()).map(right).collect();
            let samples = (points.as_slice(), strata, cone);
            let (bits, rays) = shadow_bits(&tracer, &receivers, samples, Some(&asked), range.clone());
            assert!(bits == right, "{form:?}, {strata} strata");
            let inside = range.start * words..range.end * words;
            let facing: u32 = inside.map(|at| (asked[at] & faces[at]).count_ones()).sum();
            assert_eq!(rays, u64::from(facing));
            assert!(strata == 1 || bits != asked, "something is hidden");
            assert!(facing > 0);
        }
    }
}

#[test]
fn shadow_bits_agree() {
    let mut random = Random::new(3);
    let objects = objects(&mut random);
    let (native, wgsl) = (tracer(Form::Native, &objects), tracer(Form::Wgsl, &objects));
    for (strata, cone) in [(1, false), (16, true), (33, false), (64, false), (256, true)] {
        let patterns = 5;
        let points: Vec<[f32; 4]> =
            (0..patterns * strata).map(|_| [random.range(-1.0, 1.0), 4.5, random.range(-1.0, 1.0), 0.999]).collect();
        let receivers = receivers(1500, patterns, &mut random);
        let (a, rays_a) = shadow(&native, &receivers, &points, strata, cone);
        let (b, rays_b) = shadow(&wgsl, &receivers, &points, strata, cone);
        let differing: u32 = a.iter().zip(&b).map(|(x, y)| (x ^ y).count_ones()).sum();
        let set: u32 = a.iter().map(|x| x.count_ones()).sum();
        println!("{strata} strata: {differing} bits of {set} differ, {rays_a} and {rays_b} rays");
        assert!(set > 300 && u64::from(set) < rays_a, "{set} bits of {rays_a} rays: the case tests something");
        // Both sides of an edge, or of a horizon, within rounding: a few in ten thousand rays.
        assert!(u64::from(differing) <= 1 + rays_a / 5_000, "{differing} of {rays_a}");
        assert!(rays_a.abs_diff(rays_b) <= 1 + rays_a / 5_000);
    }
    // Negative control: another cutoff of the cone is seen.
    let points: Vec<[f32; 4]> =
        (0..64).map(|_| [random.range(-1.0, 1.0), 4.5, random.range(-1.0, 1.0), 0.999]).collect();
    let receivers = receivers(1500, 1, &mut random);
    let (a, b) = (shadow(&native, &receivers, &points, 64, true).0, shadow(&wgsl, &receivers, &points, 64, false).0);
    assert!(a.iter().zip(&b).map(|(x, y)| (x ^ y).count_ones()).sum::<u32>() > 1000);
}
