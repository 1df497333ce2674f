//! The native trace against a float64 brute force, against itself in every SIMD width, and on closed meshes.
mod trace_common;
use glam::{Affine3A, Quat, Vec3};
use miplight::passes::visibility::trace_native::{Hit, Ray, SimdWidth, TraceInstance, TraceScene};
use miplight::scene::bvh::Blas;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use trace_common::{Mesh, Object, Random, brute_force, cube, grid, instances, places, ray, soup, sphere};

static GO: AtomicBool = AtomicBool::new(false);

fn scene(objects: &[Object], width: SimdWidth) -> TraceScene {
    TraceScene::new(instances(objects)).with_width(width).expect("available")
}

fn closest(scene: &TraceScene, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    scene.closest(rays, &mut hits, &GO);
    hits
}

fn any(scene: &TraceScene, rays: &[Ray]) -> Vec<bool> {
    let mut bits = vec![u32::MAX; rays.len().div_ceil(32)];
    scene.any(rays, &mut bits, &GO);
    if !rays.len().is_multiple_of(32) {
        assert_eq!(bits.last().map_or(0, |w| w >> (rays.len() % 32)), 0, "spare bits are cleared");
    }
    (0..rays.len()).map(|i| bits[i / 32] >> (i % 32) & 1 == 1).collect()
}

fn objects(random: &mut Random) -> Vec<Object> {
    let mut objects = Vec::new();
    for (i, place) in places(random).into_iter().enumerate() {
        let mesh = match i % 3 {
            0 => soup(40, 0.4, random),
            1 => sphere(1, 0.1),
            _ => cube(2),
        };
        objects.push(Object { mesh, place });
    }
    objects
}

/// Rays of every kind: random, along axes, bunched, short, grazing, through vertices and edges.
fn mixed_rays(objects: &[Object], count: usize, random: &mut Random) -> Vec<Ray> {
    let mut rays = Vec::with_capacity(count);
    let bunch = random.cube(3.0);
    for i in 0..count {
        let origin = random.cube(4.0);
        let object = &objects[random.below(objects.len())];
        let triangle = object.mesh.triangles[random.below(object.mesh.triangles.len())];
        let corner = triangle.map(|v| object.place.transform_point3(object.mesh.positions[v as usize]));
        let mut r = match i / 32 % 8 {
            0 => ray(origin, random.direction()),
            1 => ray(origin, Vec3::AXES[i % 3] * if i % 2 == 0 { 1.0 } else { -2.0 }),
            2 => ray(bunch, Vec3::new(1.0, 0.3, -0.4) + random.cube(0.1)),
            3 => ray(origin, corner[0] - origin),
            4 => ray(origin, corner[0].lerp(corner[1], random.unit()) - origin),
            5 => ray(origin, (corner[0] + corner[1] + corner[2]) / 3.0 - origin),
            6 => ray(corner[0] + (corner[0] - corner[1]), corner[1] - corner[0] + random.cube(0.01)),
            _ => ray(origin, Vec3::new(random.range(-1.0, 1.0), 0.0, random.range(-1e-3, 1e-3))),
        };
        if i % 5 == 0 {
            (r.t_min, r.t_max) = (random.range(0.0, 0.5), random.range(0.4, 3.0));
        }
        rays.push(r);
    }
    rays
}

/// Rays that differ though the reference is not in doubt.
fn wrong(objects: &[Object], rays: &[Ray], hits: &[Hit]) -> usize {
    let differs = |(r, hit): (&Ray, &Hit)| {
        let reference = brute_force(objects, r);
        let same = if reference.instance == u32::MAX {
            !hit.is_hit()
        } else {
            hit.is_hit() && (f64::from(hit.t) - reference.t).abs() <= 2e-5 * reference.t.max(0.1)
        };
        !same && reference.margin > 1e-3
    };
    rays.iter().zip(hits).filter(|&pair| differs(pair)).count()
}

#[test]
fn closest_hits_match_a_float64_brute_force() {
    let mut random = Random::new(1);
    let objects = objects(&mut random);
    let rays = mixed_rays(&objects, 8192, &mut random);
    for width in SimdWidth::available() {
        let hits = closest(&scene(&objects, width), &rays);
        assert_eq!(wrong(&objects, &rays, &hits), 0, "{width:?}");
        let count = hits.iter().filter(|h| h.is_hit()).count();
        assert!(count > 2000 && count < 7500, "the rays are worth something: {count} hits");
    }
    // Control: one object moved by a hundredth must show.
    let mut moved = scene_objects_moved(&objects);
    let hits = closest(&scene(&moved, SimdWidth::Portable), &rays);
    assert!(wrong(&objects, &rays, &hits) > 50);
    moved.clear();
}

fn scene_objects_moved(objects: &[Object]) -> Vec<Object> {
    let shift =
        |o: &Object| Object { mesh: o.mesh.clone(), place: Affine3A::from_translation(Vec3::splat(0.01)) * o.place };
    objects.iter().map(shift).collect()
}

#[test]
fn barycentrics_give_the_point_on_the_ray() {
    let mut random = Random::new(2);
    let objects = objects(&mut random);
    let rays = mixed_rays(&objects, 4096, &mut random);
    let mut worst: f32 = 0.0;
    for (r, hit) in rays.iter().zip(closest(&scene(&objects, SimdWidth::available()[0]), &rays)) {
        if !hit.is_hit() || hit.t > 20.0 {
            continue;
        }
        let object = &objects[hit.instance as usize];
        let [a, b, c] = object.mesh.triangles[hit.triangle as usize].map(|v| object.mesh.positions[v as usize]);
        let inside = object.place.transform_point3(a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v);
        let along = Vec3::from(r.origin) + Vec3::from(r.direction) * hit.t;
        // Flat-on error of the ray parameter grows with 1 / cos: compare across the ray only.
        let across = (inside - along).reject_from(Vec3::from(r.direction));
        worst = worst.max(across.length());
    }
    assert!(worst < 2e-5, "{worst}");
}

#[test]
fn all_widths_give_the_same_bits_and_any_agrees_with_closest() {
    let mut random = Random::new(3);
    let mut objects = objects(&mut random);
    objects.push(Object { mesh: soup(30_000, 0.02, &mut random), place: Affine3A::from_scale(Vec3::splat(3.0)) });
    let rays = mixed_rays(&objects, 100_001, &mut random);
    let widths = SimdWidth::available();
    let first = closest(&scene(&objects, widths[0]), &rays);
    for &width in &widths {
        let scene = scene(&objects, width);
        let hits = closest(&scene, &rays);
        let bits = |hits: &[Hit]| -> Vec<u8> { bytemuck::cast_slice(hits).to_vec() };
        assert_eq!(bits(&hits), bits(&first), "{width:?}");
        let occluded = any(&scene, &rays);
        let disagree = hits.iter().zip(&occluded).filter(|(hit, any)| hit.is_hit() != **any).count();
        assert_eq!(disagree, 0, "{width:?}");
        // Alone or among others, backwards or forwards: a ray has one answer.
        let backwards: Vec<Ray> = rays.iter().rev().copied().collect();
        let mut back = closest(&scene, &backwards);
        back.reverse();
        assert_eq!(bits(&back), bits(&first), "{width:?} backwards");
    }
    // Control: other rays, other bits.
    let mut other = rays.clone();
    other.swap(0, 1);
    assert_ne!(closest(&scene(&objects, widths[0]), &other)[..6], first[..6]);
}

/// Points on edges and vertices of a closed mesh, aimed at from inside: rays that miss.
fn leaks(mesh: &Mesh, place: Affine3A, count: usize, drop: Option<usize>, width: SimdWidth) -> usize {
    let mut random = Random::new(4);
    let mut open = mesh.clone();
    let doomed = drop.map(|t| open.triangles.remove(t));
    let blas = Arc::new(Blas::build(&open.positions, &open.triangles));
    let scene = TraceScene::new(vec![TraceInstance::new(place, blas)]).with_width(width).expect("available");
    let mut rays = Vec::with_capacity(count);
    let mut origin = Vec3::ZERO;
    for i in 0..count {
        if i % 64 == 0 {
            origin = random.cube(0.3);
        }
        let triangle = doomed.unwrap_or_else(|| mesh.triangles[random.below(mesh.triangles.len())]);
        let [a, b, _] = triangle.map(|v| mesh.positions[v as usize]);
        let target = if i % 4 == 0 { a } else { a.lerp(b, random.unit()) };
        let (from, to) = (place.transform_point3(origin), place.transform_point3(target));
        rays.push(Ray { t_max: 1e6, ..ray(from, to - from) });
    }
    any(&scene, &rays).iter().filter(|hit| !**hit).count()
}

#[test]
fn closed_meshes_have_no_leak_at_edges_and_vertices() {
    let turn = Quat::from_axis_angle(Vec3::new(0.3, 0.8, -0.5).normalize(), 1.1);
    let shift = Vec3::new(700.0, -900.0, 300.0);
    let odd = Affine3A::from_scale_rotation_translation(Vec3::new(1.7, 0.6, -1.1), turn, Vec3::new(3.0, 1.0, 2.0));
    for (mesh, count) in [(sphere(2, 0.0), 600_000), (sphere(5, 0.08), 600_000), (cube(8), 300_000)] {
        for place in [Affine3A::IDENTITY, odd, Affine3A::from_translation(shift)] {
            for width in SimdWidth::available() {
                let count = if width == SimdWidth::Portable { count / 20 } else { count };
                assert_eq!(leaks(&mesh, place, count, None, width), 0, "{width:?} {place:?}");
            }
        }
        // Control: with one triangle gone, rays at its edges escape.
        assert!(leaks(&mesh, odd, 10_000, Some(3), SimdWidth::available()[0]) > 1000);
    }
}

#[test]
fn a_ray_along_an_axis_meets_the_walls_that_it_runs_in_front_of() {
    // Origins and directions in the planes of the grid: zero components and boxes without thickness.
    let objects = [Object { mesh: cube(8), place: Affine3A::IDENTITY }];
    for width in SimdWidth::available() {
        let scene = scene(&objects, width);
        let mut rays = Vec::new();
        for i in 0..=16 {
            for j in 0..=16 {
                let (x, y) = (i as f32 / 8.0 - 1.0, j as f32 / 8.0 - 1.0);
                for axis in 0..3 {
                    let mut origin = Vec3::ZERO;
                    (origin[(axis + 1) % 3], origin[(axis + 2) % 3]) = (x, y);
                    rays.push(ray(origin, Vec3::AXES[axis]));
                    rays.push(ray(origin, -Vec3::AXES[axis]));
                    rays.push(ray(origin, Vec3::AXES[axis].map(|c| if c == 0.0 { -0.0 } else { c })));
                }
            }
        }
        let hits = closest(&scene, &rays);
        assert!(hits.iter().all(|h| h.t == 1.0), "{width:?}");
        // Control: out of the cube there is nothing.
        rays.iter_mut().for_each(|r| r.origin[0] += 2.5);
        assert!(closest(&scene, &rays).iter().filter(|h| !h.is_hit()).count() > rays.len() / 2);
    }
}

#[test]
fn ties_go_to_the_smaller_instance_and_triangle() {
    let flat = grid(3);
    let mut twice = flat.clone();
    twice.triangles.extend(flat.triangles.clone());
    let place = |mesh: &Mesh| Object { mesh: mesh.clone(), place: Affine3A::IDENTITY };
    let objects = [place(&twice), place(&flat), place(&twice)];
    let mut random = Random::new(5);
    let target = |random: &mut Random| Vec3::new(random.below(13) as f32 / 12.0, random.below(13) as f32 / 12.0, 0.0);
    let rays: Vec<Ray> =
        (0..2000).map(|_| ray(Vec3::new(0.4, 0.3, 2.0), target(&mut random) - Vec3::new(0.4, 0.3, 2.0))).collect();
    for width in SimdWidth::available() {
        let hits = closest(&scene(&objects, width), &rays);
        let once = closest(&scene(&objects[1..2], width), &rays);
        assert!(hits.iter().all(|h| h.is_hit() && h.instance == 0 && h.triangle < flat.triangles.len() as u32));
        assert!(hits.iter().zip(&once).all(|(a, b)| a.triangle == b.triangle && a.t == b.t), "{width:?}");
    }
}

#[test]
fn degenerate_input_answers_misses() {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let good = ray(Vec3::new(0.2, 0.3, 1.0), Vec3::NEG_Z);
    let mut rays = vec![good; 40];
    for (i, &value) in bad.iter().enumerate() {
        rays[i].origin[i] = value;
        rays[4 + i].direction[i] = value;
    }
    rays[8].direction = [0.0; 3];
    (rays[9].t_min, rays[9].t_max) = (3.0, 2.0);
    (rays[10].t_min, rays[11].t_max) = (f32::NAN, f32::NAN);
    rays[12].t_max = 1.0;
    rays[13].t_min = 1.0;
    let missing = [0, 1, 2, 4, 5, 6, 8, 9, 10, 11, 12, 13];
    let one = Mesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y], triangles: vec![[0, 1, 2]] };
    let singular = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
    for width in SimdWidth::available() {
        let place = |mesh: &Mesh, place| Object { mesh: mesh.clone(), place };
        let full = scene(
            &[place(&one, Affine3A::IDENTITY), place(&one, singular), place(&Mesh::default(), Affine3A::IDENTITY)],
            width,
        );
        for (i, hit) in closest(&full, &rays).iter().enumerate() {
            assert_eq!(hit.is_hit(), !missing.contains(&i), "ray {i}, {width:?}");
        }
        assert_eq!(any(&full, &rays).iter().filter(|h| **h).count(), rays.len() - missing.len());
        assert!(closest(&full, &[]).is_empty() && any(&full, &[]).is_empty());
        for objects in [vec![], vec![place(&Mesh::default(), Affine3A::IDENTITY)], vec![place(&one, singular)]] {
            assert!(closest(&scene(&objects, width), &rays).iter().all(|h| *h == Hit::MISS));
        }
    }
}

#[test]
fn a_negative_start_finds_what_is_behind() {
    let objects = [Object { mesh: grid(4), place: Affine3A::IDENTITY }];
    let behind = Ray { t_min: -5.0, ..ray(Vec3::new(0.3, 0.4, -1.0), Vec3::new(0.0, 0.0, -0.5)) };
    for width in SimdWidth::available() {
        let scene = scene(&objects, width);
        assert_eq!(closest(&scene, &[behind])[0].t, -2.0, "{width:?}");
        assert!(!any(&scene, &[Ray { t_min: 0.0, ..behind }])[0], "{width:?}");
    }
}

#[test]
fn a_cancelled_trace_leaves_the_answers_alone() {
    let objects = [Object { mesh: sphere(1, 0.0), place: Affine3A::IDENTITY }];
    let scene = scene(&objects, SimdWidth::Portable);
    let rays = vec![ray(Vec3::ZERO, Vec3::X); 10_000];
    let mark = Hit { instance: 7, ..Hit::MISS };
    let mut hits = vec![mark; rays.len()];
    scene.closest(&rays, &mut hits, &AtomicBool::new(true));
    assert!(hits.iter().all(|h| *h == mark));
    scene.closest(&rays, &mut hits, &GO);
    assert!(hits.iter().all(|h| h.instance == 0));
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let mut random = Random::new(6);
    let objects = objects(&mut random);
    let rays = mixed_rays(&objects, 50_000, &mut random);
    let scene = TraceScene::new(instances(&objects));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| closest(&scene, &rays))
    };
    assert_eq!(on(1), on(5));
}
