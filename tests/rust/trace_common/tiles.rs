//! Tiles of an image as the proofs see them, and rays that would belie a proof.
use super::{Mesh, Object, Random};
use glam::{Affine3A, Vec3};
use miplight::passes::refine::light_bounds::{LightFrame, TileBounds, flags};
use miplight::passes::visibility::prove_native::ProofTiles;
use miplight::passes::visibility::trace_native::{Hit, Ray, TraceScene};
use std::sync::atomic::AtomicBool;

pub static GO: AtomicBool = AtomicBool::new(false);
pub const SIZE: usize = 128;
pub const TILES: usize = SIZE / 8;

/// A parallelogram, or a spot where the edges are zero.
#[derive(Clone, Copy)]
pub struct Light {
    pub corner: Vec3,
    pub u: Vec3,
    pub v: Vec3,
    pub normal: Vec3,
    pub two_sided: bool,
}

impl Light {
    pub fn area(corner: Vec3, u: Vec3, v: Vec3, two_sided: bool) -> Self {
        Self { corner, u, v, normal: u.cross(v).normalize(), two_sided }
    }
    pub fn frame(&self) -> LightFrame {
        match self.u == Vec3::ZERO {
            true => LightFrame::spot(self.corner, self.normal, 0.1),
            false => LightFrame::area(self.corner, self.u, self.v, self.normal, self.two_sided),
        }
    }
    /// Largest height over the plane through `o` with normal `n`.
    pub fn top(&self, o: Vec3, n: Vec3) -> f32 {
        n.dot(self.corner - o) + n.dot(self.u).max(0.0) + n.dot(self.v).max(0.0)
    }
    /// Its opaque mesh.
    pub fn object(&self) -> Object {
        let [a, b, c] = [self.corner, self.corner + self.u, self.corner + self.v];
        let positions = vec![a, b, b + self.v, c];
        Object { mesh: Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]] }, place: Affine3A::IDENTITY }
    }
}

/// What a camera sees: rows of a G-buffer, and what the light's bounds pass makes of them.
pub struct Image {
    pub position: Vec<[u32; 4]>,
    pub normal: Vec<[u32; 4]>,
    pub geometric: Vec<[u32; 4]>,
    /// Ray origin and normal of the facing pixels of each tile.
    pub facing: Vec<Vec<(Vec3, Vec3)>>,
    pub bounds: Vec<TileBounds>,
    pub flags: Vec<u32>,
}

pub fn row(v: Vec3, w: u32) -> [u32; 4] {
    [v.x.to_bits(), v.y.to_bits(), v.z.to_bits(), w]
}

pub fn look(scene: &TraceScene, objects: &[Object], eye: Vec3, at: Vec3, light: &Light) -> Image {
    let forward = (at - eye).normalize();
    let right = forward.cross(Vec3::new(0.1, 1.0, 0.05)).normalize();
    let up = right.cross(forward);
    let offset = |i: usize| (i as f32 + 0.5) / SIZE as f32 * 2.0 - 1.0;
    let ray = |i: usize| {
        let direction = forward + right * offset(i % SIZE) - up * offset(i / SIZE);
        Ray { origin: eye.into(), t_min: 0.0, direction: direction.into(), t_max: f32::INFINITY }
    };
    let rays: Vec<Ray> = (0..SIZE * SIZE).map(ray).collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    scene.closest(&rays, &mut hits, &GO);
    let empty = vec![[0; 4]; rays.len()];
    let none = TileBounds { lo: [f32::MAX; 3], facing: 0, hi: [f32::MIN; 3], pad: 0 };
    let mut image = Image {
        position: empty.clone(),
        normal: empty.clone(),
        geometric: empty,
        facing: vec![Vec::new(); TILES * TILES],
        bounds: vec![none; TILES * TILES],
        flags: vec![0; TILES * TILES],
    };
    let extent = objects.iter().flat_map(|o| o.mesh.positions.iter().map(|p| o.place.transform_point3(*p)));
    let reach = extent.fold(0.0_f32, |r, p| r.max(p.abs().max_element()));
    for (at, (ray, hit)) in rays.iter().zip(&hits).enumerate().filter(|(_, (_, hit))| hit.is_hit()) {
        let object = &objects[hit.instance as usize];
        let triangle = object.mesh.triangles[hit.triangle as usize];
        let [a, b, c] = triangle.map(|v| object.place.transform_point3(object.mesh.positions[v as usize]));
        let p = a + hit.u * (b - a) + hit.v * (c - a);
        let n = (b - a).cross(c - a).normalize();
        let n = if n.dot(Vec3::from(ray.direction)) > 0.0 { -n } else { n };
        image.add(at, p, n, reach * 1.5e-6, light);
    }
    image
}

impl Image {
    pub fn add(&mut self, at: usize, p: Vec3, n: Vec3, error: f32, light: &Light) {
        let (x, y) = (at % SIZE, at / SIZE);
        let tile = y / 8 * TILES + x / 8;
        (self.position[at], self.normal[at], self.geometric[at]) = (row(p, error.to_bits()), row(n, 1), row(n, 0));
        let (o, frame) = (p + n * error, light.frame());
        let place = [frame.dual_u, frame.dual_v, frame.normal].map(|axis| (o - light.corner).dot(axis.into()));
        let emits = if light.two_sided { place[2] != 0.0 } else { place[2] > 0.0 };
        self.flags[tile] |= flags::SURFACE;
        if !emits || light.top(o, n) <= 0.0 {
            return;
        }
        let (bounds, flag) = (&mut self.bounds[tile], &mut self.flags[tile]);
        let side = if place[2] < 0.0 { flags::BACK } else { 0 };
        if *flag & flags::FACING != 0 && *flag & flags::BACK != side {
            *flag |= flags::MIXED_SIDES;
        }
        *flag |= flags::FACING | side;
        let place = [place[0], place[1], place[2].abs()];
        for (i, &x) in place.iter().enumerate() {
            bounds.lo[i] = bounds.lo[i].min(x);
            bounds.hi[i] = bounds.hi[i].max(x);
        }
        bounds.facing += 1;
        self.facing[tile].push((o, n));
    }

    pub fn prove(&self, scene: &TraceScene, light: &Light) -> Vec<u32> {
        let frame = light.frame();
        let tiles = ProofTiles {
            frame: &frame,
            bounds: &self.bounds,
            position: &self.position,
            normal: &self.normal,
            geometric: &self.geometric,
            width: SIZE as u32,
            height: SIZE as u32,
        };
        let mut found = self.flags.clone();
        let (first, rest) = found.split_at_mut(TILES);
        scene.prove(&tiles, 0, first, &GO);
        scene.prove(&tiles, TILES, rest, &GO);
        found
    }

    /// Tiles that face the light, those proven lit and those proven dark.
    pub fn count(&self, found: &[u32]) -> [usize; 3] {
        [flags::FACING, flags::LIT, flags::DARK].map(|bit| found.iter().filter(|&&f| f & bit != 0).count())
    }

    /// Rays that belie the proofs, of those traced: blocked ones of lit tiles, free ones of dark tiles.
    pub fn faults(&self, scene: &TraceScene, light: &Light, found: &[u32], random: &mut Random) -> [usize; 2] {
        let (mut rays, mut dark) = (Vec::new(), Vec::new());
        for (tile, flag) in found.iter().enumerate().filter(|(_, f)| *f & (flags::LIT | flags::DARK) != 0) {
            for &(o, n) in &self.facing[tile] {
                for k in 0..24 {
                    // Corners and edges of the light, then its inside.
                    let [mut a, mut b] = [random.unit(), random.unit()];
                    a = if k < 8 { (k & 1) as f32 } else { a };
                    b = if k < 4 { (k >> 1) as f32 } else { b };
                    let d = light.corner + a * light.u + b * light.v - o;
                    if n.dot(d) > 0.0 {
                        rays.push(Ray { origin: o.into(), t_min: 0.0, direction: d.into(), t_max: 0.9999 });
                        dark.push(flag & flags::DARK != 0);
                    }
                }
            }
        }
        let mut occluded = vec![0; rays.len().div_ceil(32)];
        scene.any(&rays, &mut occluded, &GO);
        let hidden = |i: usize| occluded[i / 32] >> (i % 32) & 1 == 1;
        [(0..rays.len()).filter(|&i| hidden(i) != dark[i]).count(), rays.len()]
    }
}

pub fn lights() -> Vec<Light> {
    let slanted = Light::area(Vec3::new(-4.0, 3.0, -3.0), Vec3::new(1.5, 0.5, 0.3), Vec3::new(0.2, -0.4, 1.3), true);
    let spot = Light { u: Vec3::ZERO, v: Vec3::ZERO, ..Light::area(Vec3::new(1.0, 4.5, 0.5), Vec3::X, Vec3::Z, false) };
    vec![
        Light::area(Vec3::new(-1.0, 4.99, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, false),
        Light::area(Vec3::new(-1.0, 4.9, -1.0), Vec3::X * 0.02, Vec3::new(0.01, 0.0, 0.02), false),
        slanted,
        Light { normal: Vec3::new(0.1, -1.0, 0.2).normalize(), ..spot },
    ]
}

/// `u × v` of a ceiling's light points down.
pub fn lit_side_down(light: Light) -> Light {
    if light.u.cross(light.v).dot(light.normal) >= 0.0 && light.normal.y > 0.0 && !light.two_sided {
        Light::area(light.corner, light.v, light.u, false)
    } else {
        light
    }
}
