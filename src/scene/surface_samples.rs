//! Points spread evenly over a mesh: of several times as many candidates, drawn by area, those most crowded go until few
//! enough are left [Yuk15]; what each stands for is the area of the candidates to which it is the nearest.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};
use std::hash::{BuildHasherDefault, Hasher};

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// Candidates for each sample, as in [Yuk15].
const CANDIDATES: usize = 5;
/// Exponent of a neighbour's weight [Yuk15 Eq. 3].
const ALPHA: i32 = 8;

/// A point of a mesh: p = (1 - u - v) p0 + u p1 + v p2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceSample {
    /// Of the mesh.
    pub triangle: u32,
    /// Weight of vertex 1.
    pub u: f32,
    /// Weight of vertex 2.
    pub v: f32,
    /// That it stands for, after the transform.
    pub area: f64,
}

/// Triangles of a mesh after a linear map, with the areas up to each.
struct Triangles<'m> {
    positions: &'m [Vec3],
    triangles: &'m [[u32; 3]],
    map: DMat3,
    sums: Vec<f64>,
}

impl<'m> Triangles<'m> {
    fn new(positions: &'m [Vec3], triangles: &'m [[u32; 3]], map: DMat3) -> Self {
        let mut made = Self { positions, triangles, map, sums: Vec::new() };
        let areas: Vec<f64> = (0..triangles.len()).into_par_iter().map(|t| made.twice(t).length() * 0.5).collect();
        made.sums.push(0.0);
        let mut sum = 0.0;
        for area in areas {
            sum += area;
            made.sums.push(sum);
        }
        made
    }

    fn area(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|v| self.map * self.positions[v as usize].as_dvec3())
    }

    /// The normal, as long as the triangle's area twice.
    fn twice(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }
}

/// The area of triangles after a linear map.
pub fn area(positions: &[Vec3], triangles: &[[u32; 3]], map: DMat3) -> f64 {
    Triangles::new(positions, triangles, map).area()
}

/// Number of a candidate, and how far away it is.
type Near = (u32, f32);

struct Candidate {
    sample: SurfaceSample,
    position: DVec3,
    normal: DVec3,
}

/// Three numbers in [0, 1) that depend on nothing but the arguments.
fn random(seed: u64, index: u64) -> [f64; 3] {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ index.wrapping_mul(0xd134_2543_de82_ef95);
    // SplitMix64.
    [(); 3].map(|()| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 * 2.0_f64.powi(-64)
    })
}

/// One candidate in each of `count` equal parts of the area, in the order of the triangles.
fn candidates(mesh: &Triangles<'_>, count: usize, seed: u64) -> Vec<Candidate> {
    let area = mesh.area();
    let each = area / count as f64;
    (0..count)
        .into_par_iter()
        .map(|i| {
            let [place, u, v] = random(seed, i as u64);
            let at = (i as f64 + place) * each;
            let triangle = mesh.sums.partition_point(|sum| *sum <= at).clamp(1, mesh.triangles.len()) - 1;
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let [a, b, c] = mesh.corners(triangle);
            let sample = SurfaceSample { triangle: triangle as u32, u: u as f32, v: v as f32, area: each };
            let normal = mesh.twice(triangle).normalize_or_zero();
            Candidate { sample, position: a + u * (b - a) + v * (c - a), normal }
        })
        .collect()
}

/// Spreads the number of a cube; no one chooses them to collide.
#[derive(Default)]
struct Spread(u64);

impl Hasher for Spread {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_u64(u64::from(*byte)));
    }

    fn write_u64(&mut self, number: u64) {
        let mixed = (self.0 ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 32);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

/// Points in cubes, so that those near a place are found.
struct Cubes {
    width: f64,
    held: HashMap<u64, Vec<u32>, BuildHasherDefault<Spread>>,
}

impl Cubes {
    fn new(points: &[Candidate], kept: impl Iterator<Item = u32>, width: f64) -> Self {
        let mut held: HashMap<_, Vec<u32>, BuildHasherDefault<Spread>> = HashMap::default();
        for i in kept {
            held.entry(number(cube(points[i as usize].position, width))).or_default().push(i);
        }
        Self { width, held }
    }

    /// Points within `width` of `of` on surfaces that face the same way: the two sides of a sheet are apart.
    fn near(&self, points: &[Candidate], of: &Candidate) -> Vec<Near> {
        let [x, y, z] = cube(of.position, self.width);
        let mut found = Vec::with_capacity(32);
        for beside in 0..27 {
            let place = [x + beside % 3 - 1, y + beside / 3 % 3 - 1, z + beside / 9 - 1];
            for &i in self.held.get(&number(place)).map_or(&[][..], Vec::as_slice) {
                let other = &points[i as usize];
                let distance = other.position.distance_squared(of.position);
                if distance < self.width * self.width && other.normal.dot(of.normal) > 0.0 {
                    found.push((i, distance.sqrt() as f32));
                }
            }
        }
        found
    }
}

fn cube(position: DVec3, width: f64) -> [i64; 3] {
    (position / width).floor().to_array().map(|x| x as i64)
}

/// Unlike those of the cubes beside it; that it is also one far away costs a look at what is not near.
fn number([x, y, z]: [i64; 3]) -> u64 {
    let low = |number: i64| number as u64 & 0x1f_ffff;
    low(x) | low(y) << 21 | low(z) << 42
}

/// How crowded a candidate is; the most crowded goes first, of equals the later one.
#[derive(PartialEq)]
struct Crowded(f64, u32);

impl Eq for Crowded {}

impl PartialOrd for Crowded {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Crowded {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

/// Numbers of the `count` candidates that are left, in order.
fn eliminate(points: &[Candidate], count: usize, reach: f64) -> Vec<u32> {
    let cubes = Cubes::new(points, 0..points.len() as u32, reach);
    let weight = |distance: f32| (1.0 - f64::from(distance) / reach).max(0.0).powi(ALPHA) as f32;
    let neighbours: Vec<Vec<Near>> = points
        .par_iter()
        .enumerate()
        .map(|(i, point)| {
            let near = cubes.near(points, point);
            near.into_iter().filter(|(j, _)| *j != i as u32).map(|(j, distance)| (j, weight(distance))).collect()
        })
        .collect();
    let mut sums: Vec<f64> =
        neighbours.iter().map(|near| near.iter().map(|(_, weight)| f64::from(*weight)).sum()).collect();
    let mut gone = vec![false; points.len()];
    let mut queue: BinaryHeap<Crowded> = sums.iter().enumerate().map(|(i, sum)| Crowded(*sum, i as u32)).collect();
    let mut left = points.len();
    while left > count {
        let Some(Crowded(sum, i)) = queue.pop() else { break };
        let i = i as usize;
        if gone[i] {
            continue;
        }
        // An entry from before a neighbour went comes back with what is left of it.
        if sum > sums[i] {
            queue.push(Crowded(sums[i], i as u32));
            continue;
        }
        gone[i] = true;
        left -= 1;
        for &(j, weight) in &neighbours[i] {
            sums[j as usize] -= f64::from(weight);
        }
    }
    (0..points.len() as u32).filter(|i| !gone[*i as usize]).collect()
}

/// `count` points on the triangles as they are after `map`, in the order of the triangles; their areas add up to all.
pub fn sample(positions: &[Vec3], triangles: &[[u32; 3]], map: DMat3, count: usize, seed: u64) -> Vec<SurfaceSample> {
    let mesh = Triangles::new(positions, triangles, map);
    let area = mesh.area();
    if count == 0 || !(area > 0.0 && area.is_finite()) {
        return Vec::new();
    }
    let points = candidates(&mesh, CANDIDATES * count, seed);
    // Twice the largest radius that so many discs could have [Yuk15 Eq. 2].
    let reach = 2.0 * (area / (2.0 * 3.0_f64.sqrt() * count as f64)).sqrt();
    let kept = eliminate(&points, count, reach);
    let places: HashMap<u32, usize> = kept.iter().enumerate().map(|(place, i)| (*i, place)).collect();
    let cubes = Cubes::new(&points, kept.iter().copied(), reach);
    let nearest = |point: &Candidate| {
        let near = cubes.near(&points, point).into_iter();
        // Where nothing near faces the same way, the nearest of all.
        let all = || kept.iter().map(|&i| (i, points[i as usize].position.distance(point.position) as f32));
        let closer = |a: &Near, b: &Near| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0));
        near.min_by(closer).or_else(|| all().min_by(closer)).map_or(0, |(i, _)| places[&i])
    };
    let owners: Vec<usize> = points.par_iter().map(nearest).collect();
    let mut samples: Vec<SurfaceSample> =
        kept.iter().map(|&i| SurfaceSample { area: 0.0, ..points[i as usize].sample }).collect();
    for (owner, point) in owners.into_iter().zip(&points) {
        samples[owner].area += point.sample.area;
    }
    samples
}

#[cfg(test)]
mod tests;
