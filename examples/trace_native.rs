//! Rates of the native trace: a room of 10 units with a bumpy sphere, a light of 2 × 2 in the ceiling, a camera of 256².
//!
//! `cargo run --release --example trace_native [TRIANGLES...]`; `benches/trace_mitsuba.py` times the same scene in Mitsuba.
use glam::{Affine3A, Vec3};
use miplight::passes::visibility::trace_native::{
    Hit, Ray, Receiver, SampleTable, SimdWidth, TraceInstance, TraceScene,
};
use miplight::scene::bvh::Blas;
use std::f32::consts::{PI, TAU};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

const SIZE: usize = 256;
const STRATA_SIDE: usize = 16;
const STRATA: usize = STRATA_SIDE * STRATA_SIDE;
const PATTERNS: usize = 64;
static GO: AtomicBool = AtomicBool::new(false);

/// Uniform numbers from a counter.
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
fn bumpy_sphere(count: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
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
    for i in 0..rings as u32 {
        for j in 0..around as u32 {
            let (n, next) = (around as u32, (j + 1) % around as u32);
            let [a, b, c, d] = [i * n + j, i * n + next, (i + 1) * n + next, (i + 1) * n + j];
            if i > 0 {
                triangles.push([a, b, c]);
            }
            if i + 1 < rings as u32 {
                triangles.push([a, c, d]);
            }
        }
    }
    (positions, triangles)
}

fn scene(count: usize) -> TraceScene {
    let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 10.0 - 5.0;
    let walls = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = walls.iter().flat_map(|w| [[w[0], w[1], w[2]], [w[0], w[2], w[3]]]).collect();
    let room = Blas::build(&(0..8).map(corner).collect::<Vec<_>>(), &triangles);
    let light = [
        Vec3::new(-1.0, 4.99, -1.0),
        Vec3::new(1.0, 4.99, -1.0),
        Vec3::new(1.0, 4.99, 1.0),
        Vec3::new(-1.0, 4.99, 1.0),
    ];
    let light = Blas::build(&light, &[[0, 1, 2], [0, 2, 3]]);
    let (positions, triangles) = bumpy_sphere(count);
    let start = Instant::now();
    let sphere = Blas::build(&positions, &triangles);
    println!("{} triangles, built in {:.1} ms", triangles.len(), start.elapsed().as_secs_f64() * 1e3);
    let place = |blas| TraceInstance::new(Affine3A::IDENTITY, Arc::new(blas));
    TraceScene::new(vec![place(room), place(sphere), place(light)])
}

/// Visible points of the camera in tiles of 8 × 8 pixels, with their facing normals.
fn receivers(scene: &TraceScene, count: usize) -> Vec<Receiver> {
    let half = (PI / 6.0).tan();
    let mut rays = Vec::new();
    let tiles = SIZE / 8;
    for i in 0..SIZE * SIZE {
        let (tile, pixel) = (i / 64, i % 64);
        let (x, y) = (tile % tiles * 8 + pixel % 8, tile / tiles * 8 + pixel / 8);
        let at = |p: usize| ((p as f32 + 0.5) / SIZE as f32 * 2.0 - 1.0) * half;
        rays.push(Ray { origin: [0.0, 0.0, -4.9], t_min: 0.0, direction: [at(x), -at(y), 1.0], t_max: f32::INFINITY });
    }
    let mut hits = vec![Hit::MISS; rays.len()];
    scene.closest(&rays, &mut hits, &GO);
    let (positions, triangles) = bumpy_sphere(count);
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
    rays.iter().zip(&hits).enumerate().map(receiver).collect()
}

/// Cell of a stratum, in Morton order: any 16 in a row, from a multiple of 16 on, fill a square.
fn cell_of(k: usize) -> (usize, usize) {
    let even = |v: usize| (0..4).map(|bit| (v >> (2 * bit) & 1) << bit).sum();
    (even(k), even(k >> 1))
}

fn samples(random: &mut Random) -> Vec<[f32; 4]> {
    let cell = 2.0 / STRATA_SIDE as f32;
    let sample = |i: usize| {
        let (x, z) = cell_of(i % STRATA);
        [(x as f32 + random.unit()) * cell - 1.0, 4.99, (z as f32 + random.unit()) * cell - 1.0, 0.999]
    };
    (0..PATTERNS * STRATA).map(sample).collect()
}

/// Cosine-distributed rays, stratum after stratum within each tile of 64 receivers.
fn hemisphere(receivers: &[Receiver], random: &mut Random) -> Vec<Ray> {
    let mut rays = Vec::with_capacity(receivers.len() * STRATA);
    for tile in receivers.chunks(64) {
        for k in 0..STRATA {
            for r in tile {
                let (x, y) = cell_of(k);
                let u = (x as f32 + random.unit()) / STRATA_SIDE as f32;
                let v = (y as f32 + random.unit()) / STRATA_SIDE as f32;
                let n = Vec3::from(r.normal_geo);
                let (s, t) = n.any_orthonormal_pair();
                let (radius, phi) = (u.sqrt(), TAU * v);
                let d = s * (radius * phi.cos()) + t * (radius * phi.sin()) + n * (1.0 - u).max(0.0).sqrt();
                rays.push(Ray { origin: r.origin, t_min: 0.0, direction: d.into(), t_max: f32::INFINITY });
            }
        }
    }
    rays
}

/// Seconds of processor time so far, all threads; NaN where the system does not say.
fn processor_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let seconds = threads.flatten().filter_map(|thread| {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    });
    seconds.sum::<f64>() / 1e9
}

/// Best of three, in millions per second; and per second of one core, which a busy machine disturbs less.
fn rate(mut run: impl FnMut() -> u64) -> (f64, f64) {
    let mut best = (0.0, 0.0_f64);
    for _ in 0..3 {
        let (start, used) = (Instant::now(), processor_seconds());
        let rays = run() as f64 / 1e6;
        best.0 = f64::max(best.0, rays / start.elapsed().as_secs_f64());
        best.1 = best.1.max(rays / (processor_seconds() - used));
    }
    best
}

fn main() {
    let sizes: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let sizes = if sizes.is_empty() { vec![1_000, 10_000, 100_000] } else { sizes };
    println!("M rays/s on {} threads, and per second of one core", rayon::current_num_threads());
    println!("{:>9} {:>9} {:>16} {:>16}", "triangles", "width", "shadow", "hemisphere");
    for size in sizes {
        let mut random = Random(7);
        let points = samples(&mut random);
        let table = SampleTable {
            points: &points,
            strata: STRATA as u32,
            light_normal: [0.0, -1.0, 0.0],
            two_sided: false,
            cone_axis: [0.0; 3],
            cos_cutoff: -2.0,
        };
        let base = scene(size);
        let receivers = receivers(&base, size);
        let part = &receivers[..receivers.len() / 4 * 3][receivers.len() / 2..];
        let rays = hemisphere(part, &mut random);
        let mut bits = vec![0; receivers.len() * table.words()];
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut scene = Some(base);
        for width in SimdWidth::available() {
            if std::env::var("WIDTH").is_ok_and(|w| w != format!("{width:?}")) {
                continue;
            }
            let s = scene.take().and_then(|s| s.with_width(width)).expect("available");
            let shadow = rate(|| s.shadow(&receivers, &table, &mut bits, &GO));
            let closest = rate(|| {
                s.closest(&rays, &mut hits, &GO);
                rays.len() as u64
            });
            let pair = |(wall, core): (f64, f64)| format!("{wall:.1} ({core:.1})");
            println!("{size:>9} {:>9} {:>16} {:>16}", format!("{width:?}"), pair(shadow), pair(closest));
            scene = Some(s);
        }
        let lit: u64 = bits.iter().map(|w| u64::from(w.count_ones())).sum();
        let near = hits.iter().filter(|h| h.instance == 1).count();
        println!(
            "{:>9} lit {:.3}, on the sphere {:.3}",
            "",
            lit as f64 / (receivers.len() * STRATA) as f64,
            near as f64 / hits.len() as f64
        );
    }
}
