//! Rates of both forms of the trace on this adapter, and of lending buffers to the host against copying them.
//!
//! `cargo run --release --example trace_forms [TRIANGLES...]`; 256² receivers × 64 strata of a light, 256² × 16 rays
//! over the hemispheres. A room of 10 units, a bumpy sphere in it, a light of 2 × 2 in the ceiling.
use std::f32::consts::{PI, TAU};
use std::sync::Arc;
use std::time::Instant;

use glam::{Affine3A, Vec3};
use miplight::error::Result;
use miplight::gpu::{Gpu, Usage, never};
use miplight::passes::visibility::shadow::ShadowLight;
use miplight::passes::visibility::trace::{Form, Tracer};
use miplight::passes::visibility::trace_native::{Hit, Ray, Receiver, TraceInstance};
use miplight::scene::bvh::Blas;

const SIZE: usize = 256;
const STRATA: usize = 64;
const PATTERNS: usize = 64;
const HEMISPHERE: usize = 16;

/// Uniform numbers from a counter (splitmix64).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / 16_777_216.0
    }
}

/// Sphere by longitude and latitude with bumps, about `count` triangles.
fn sphere(count: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let rings = ((count as f32 / 4.0).sqrt() as usize).max(3);
    let around = 2 * rings;
    let mut positions = Vec::new();
    for i in 0..=rings {
        for j in 0..around {
            let (theta, phi) = (PI * i as f32 / rings as f32, TAU * j as f32 / around as f32);
            let radius = 2.0 * (1.0 + 0.05 * (8.0 * theta).sin() * (6.0 * phi).cos());
            let unit = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            positions.push(Vec3::new(0.0, -2.0, 0.0) + radius * unit);
        }
    }
    let mut triangles = Vec::new();
    for cell in 0..(rings * around) as u32 {
        let (n, i, j) = (around as u32, cell / around as u32, cell % around as u32);
        let next = (j + 1) % n;
        let [a, b, c, d] = [i * n + j, i * n + next, (i + 1) * n + next, (i + 1) * n + j];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    (positions, triangles)
}

fn instances(count: usize) -> Vec<TraceInstance> {
    let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 10.0 - 5.0;
    let walls = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let sides: Vec<[u32; 3]> = walls.iter().flat_map(|w| [[w[0], w[1], w[2]], [w[0], w[2], w[3]]]).collect();
    let room = Blas::build(&(0..8).map(corner).collect::<Vec<_>>(), &sides);
    let light = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| Vec3::new(x, 4.99, z));
    let light = Blas::build(&light, &[[0, 1, 2], [0, 2, 3]]);
    let (positions, triangles) = sphere(count);
    let started = Instant::now();
    let ball = Blas::build(&positions, &triangles);
    let ms = started.elapsed().as_secs_f64() * 1e3;
    println!("\n{} triangles, built in {ms:.1} ms, {} levels", triangles.len(), ball.depth_bvh2());
    [room, ball, light].map(|blas| TraceInstance::new(Affine3A::IDENTITY, Arc::new(blas))).to_vec()
}

/// Rays of the camera in tiles of 8 × 8 pixels.
fn camera() -> Vec<Ray> {
    let half = (PI / 6.0).tan();
    let tiles = SIZE / 8;
    let pixel = |i: usize| {
        let (tile, pixel) = (i / 64, i % 64);
        let (x, y) = (tile % tiles * 8 + pixel % 8, tile / tiles * 8 + pixel / 8);
        let at = |p: usize| ((p as f32 + 0.5) / SIZE as f32 * 2.0 - 1.0) * half;
        Ray { origin: [0.0, 0.0, -4.9], t_min: 0.0, direction: [at(x), -at(y), 1.0], t_max: f32::INFINITY }
    };
    (0..SIZE * SIZE).map(pixel).collect()
}

fn receivers(rays: &[Ray], hits: &[Hit], count: usize) -> Vec<Receiver> {
    let (positions, triangles) = sphere(count);
    let receiver = |(i, (ray, hit)): (usize, (&Ray, &Hit))| {
        let direction = Vec3::from(ray.direction);
        let p = Vec3::from(ray.origin) + direction * hit.t;
        let normal = match hit.instance {
            1 => {
                let [a, b, c] = triangles[hit.triangle as usize].map(|v| positions[v as usize]);
                (b - a).cross(c - a).normalize()
            }
            2 => Vec3::NEG_Y,
            _ => [Vec3::X, Vec3::Y, Vec3::Z][p.abs().max_position()] * -p[p.abs().max_position()].signum(),
        };
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let (origin, n) = ((p + normal * 1e-4).into(), normal.into());
        Receiver { origin, pattern: (i % PATTERNS) as u32, normal_geo: n, flags: 0, normal_shade: n, pixel: i as u32 }
    };
    rays.iter().zip(hits).enumerate().map(receiver).collect()
}

/// Cosine-distributed rays, stratum after stratum within each tile of 64 receivers.
fn hemisphere(receivers: &[Receiver], random: &mut Random) -> Vec<Ray> {
    let mut rays = Vec::with_capacity(receivers.len() * HEMISPHERE);
    for tile in receivers.chunks(64) {
        for k in 0..HEMISPHERE {
            for r in tile {
                let n = Vec3::from(r.normal_geo);
                let (x, y) = n.any_orthonormal_pair();
                let (u, v) = (((k % 4) as f32 + random.unit()) / 4.0, ((k / 4) as f32 + random.unit()) / 4.0);
                let d = x * (u.sqrt() * (TAU * v).cos()) + y * (u.sqrt() * (TAU * v).sin()) + n * (1.0 - u).sqrt();
                rays.push(Ray { origin: r.origin, t_min: 0.0, direction: d.into(), t_max: f32::INFINITY });
            }
        }
    }
    rays
}

/// Best of some runs, in million rays a second, and the rays of one run.
fn rate(
    gpu: &Gpu,
    tracer: &Tracer,
    mut run: impl FnMut(&mut miplight::gpu::Recorder<'_>) -> Result<u64>,
) -> Result<(f64, u64)> {
    let mut best = (0.0_f64, 0);
    tracer.device_rays(gpu)?;
    for _ in 0..3 {
        let mut recorder = gpu.record(never())?;
        let rays = run(&mut recorder)?;
        let times = recorder.finish()?;
        let rays = rays + tracer.device_rays(gpu)?;
        best = (best.0.max(rays as f64 / (times.of("trace") * 1e3)), rays);
    }
    Ok(best)
}

fn bench(gpu: &Gpu, count: usize) -> Result<()> {
    let instances = instances(count);
    let primary = camera();
    let list = gpu.upload("primary", &primary)?;
    let mut random = Random(7);
    for form in [Form::Native, Form::Wgsl] {
        let mut tracer = Tracer::with_form(gpu, form)?;
        let started = Instant::now();
        tracer.set_scene(gpu, instances.clone())?;
        gpu.wait()?;
        println!("{form:?}: scene set in {:.2} ms", started.elapsed().as_secs_f64() * 1e3);
        let hits = gpu.buffer::<Hit>("hits", primary.len() * HEMISPHERE, Usage::Storage)?;
        let camera = rate(gpu, &tracer, |r| tracer.closest(r, "trace", &list, &hits, 0..primary.len()))?;
        let seen = receivers(&primary, &gpu.read(&hits)?, count);
        let diffuse = gpu.upload("hemisphere", &hemisphere(&seen, &mut random))?;
        let cell = 2.0 / (STRATA as f32).sqrt();
        let at = |k: usize, r: &mut Random| (k as f32 + r.unit()) * cell - 1.0;
        let sample = |i: usize, r: &mut Random| [at(i % 8, r), 4.99, at(i / 8 % 8, r), 0.999];
        let points: Vec<[f32; 4]> = (0..PATTERNS * STRATA).map(|i| sample(i, &mut random)).collect();
        let points = gpu.upload("points", &points)?;
        let light = ShadowLight {
            points: &points,
            strata: STRATA as u32,
            light_normal: [0.0, -1.0, 0.0],
            two_sided: false,
            cone_axis: [0.0, -1.0, 0.0],
            cos_cutoff: -2.0,
        };
        let receivers = gpu.upload("receivers", &seen)?;
        let bits = gpu.buffer::<u32>("visibility", seen.len() * light.words(), Usage::Storage)?;
        let words = gpu.buffer::<u32>("occluded", diffuse.len() / 32, Usage::Storage)?;
        let shadow = rate(gpu, &tracer, |r| tracer.shadow(r, "trace", &receivers, &light, &bits, 0..seen.len()))?;
        let closest = rate(gpu, &tracer, |r| tracer.closest(r, "trace", &diffuse, &hits, 0..diffuse.len()))?;
        let any = rate(gpu, &tracer, |r| tracer.any(r, "trace", &diffuse, &words, 0..diffuse.len()))?;
        for (name, (rate, rays)) in
            [("camera", camera), ("shadow", shadow), ("hemisphere, closest", closest), ("hemisphere, any", any)]
        {
            println!("  {name:22} {rate:8.2} M rays/s   ({rays} rays)");
        }
    }
    Ok(())
}

/// Time of handing `count` rays to the host and as many hits back, milliseconds, best of five.
fn lend(gpu: &Gpu, count: usize, in_place: bool) -> Result<f64> {
    let rays = gpu.buffer::<Ray>("rays", count, Usage::Storage)?;
    let hits = gpu.buffer::<Hit>("hits", count, Usage::Storage)?;
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let started = Instant::now();
        if in_place {
            let input = gpu.view(&rays, 0..count)?;
            let mut output = gpu.view_mut(&hits, 0..count)?;
            output[0].t = input[0].t_max;
            drop(input);
            output.commit(gpu)?;
        } else {
            let input = gpu.read(&rays)?;
            let output = vec![Hit { t: input[0].t_max, ..Hit::MISS }; count];
            hits.write(gpu, 0, &output)?;
        }
        gpu.queue().submit([]);
        gpu.wait()?;
        best = best.min(started.elapsed().as_secs_f64() * 1e3);
    }
    Ok(best)
}

fn main() -> Result<()> {
    let gpu = Gpu::new("auto")?;
    println!("{:?}", gpu.facts());
    for count in [1 << 16, 1 << 20] {
        let (lent, copied) = (lend(&gpu, count, true)?, lend(&gpu, count, false)?);
        println!("{count} rays to the host and hits back: lent in {lent:.2} ms, copied in {copied:.2} ms");
    }
    let counts: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    for count in if counts.is_empty() { vec![1_000, 10_000, 100_000] } else { counts } {
        bench(&gpu, count)?;
    }
    Ok(())
}
