//! The two forms of the trace give the same answers: on random and on nasty rays.
//!
//! They share trees and transforms but not their arithmetic (fused or not, exact edges or edges with a hair of slack),
//! so answers may differ where a ray passes within rounding of an edge or of an end. Such rays are found by a float64
//! brute force; everywhere else the forms must agree in what is hit, and in `t` to 2e-5.
mod trace_common;

use glam::{Affine3A, DVec3, Vec3};
use miplight::error::Error;
use miplight::gpu::{Gpu, Usage, never};
use miplight::passes::visibility::trace::{Form, Tracer};
use miplight::passes::visibility::trace_native::{Hit, Ray, Receiver, TraceInstance};
use miplight::scene::bvh::Blas;
use std::sync::{Arc, OnceLock};
use trace_common::{Mesh, Object, Random, brute_force, cube, grid, instances, places, ray, soup, sphere};

fn device() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| Gpu::new("auto").expect("these tests need an adapter; Mesa's llvmpipe will do"))
}

fn tracer(form: Form, objects: &[Object]) -> Tracer {
    let mut tracer = Tracer::with_form(device(), form).unwrap();
    tracer.set_scene(device(), instances(objects)).unwrap();
    tracer
}

/// Closest hits, occlusion, and the number of rays.
fn answers(tracer: &Tracer, rays: &[Ray]) -> (Vec<Hit>, Vec<bool>, u64) {
    let gpu = device();
    let list = gpu.upload("rays", rays).unwrap();
    let hits = gpu.upload("hits", &vec![Hit { t: -1.0, ..Hit::MISS }; rays.len()]).unwrap();
    let words = gpu.upload("occluded", &vec![u32::MAX; rays.len().div_ceil(32)]).unwrap();
    let mut recorder = gpu.record(never()).unwrap();
    let mut count = tracer.closest(&mut recorder, "trace", &list, &hits, 0..rays.len()).unwrap();
    count += tracer.any(&mut recorder, "shadow", &list, &words, 0..rays.len()).unwrap();
    let times = recorder.finish().unwrap();
    assert!(times.of("trace") > 0.0 && times.of("shadow") > 0.0, "{times:?}");
    count += tracer.device_rays(gpu).unwrap();
    let bits = gpu.read(&words).unwrap();
    if !rays.len().is_multiple_of(32) {
        assert_eq!(bits.last().map_or(0, |w| w >> (rays.len() % 32)), 0, "spare bits are cleared");
    }
    let occluded = (0..rays.len()).map(|i| bits[i / 32] >> (i % 32) & 1 == 1).collect();
    (gpu.read(&hits).unwrap(), occluded, count)
}

fn objects(random: &mut Random) -> Vec<Object> {
    let mesh = |i: usize, random: &mut Random| match i % 3 {
        0 => soup(60, 0.4, random),
        1 => sphere(2, 0.1),
        _ => cube(3),
    };
    places(random).into_iter().enumerate().map(|(i, place)| Object { mesh: mesh(i, random), place }).collect()
}

/// Random rays, rays along axes, through corners, along edges, grazing, inside and outside, short ones and faulty ones.
fn nasty_rays(objects: &[Object], count: usize, random: &mut Random) -> Vec<Ray> {
    let mut rays = Vec::with_capacity(count);
    for i in 0..count {
        let object = &objects[random.below(objects.len())];
        let triangle = object.mesh.triangles[random.below(object.mesh.triangles.len())];
        let corner = triangle.map(|v| object.place.transform_point3(object.mesh.positions[v as usize]));
        let middle = (corner[0] + corner[1] + corner[2]) / 3.0;
        let origin = if i % 2 == 0 { random.cube(4.0) } else { random.cube(0.5) + object.place.translation.to_vec3() };
        let mut r = match i / 8 % 9 {
            0 => ray(origin, random.direction()),
            1 => ray(origin, Vec3::AXES[i % 3] * if i % 2 == 0 { 1.0 } else { -3.0 }),
            2 => ray(origin, corner[0] - origin),
            3 => ray(origin, corner[0].lerp(corner[1], random.unit()) - origin),
            4 => ray(origin, middle - origin),
            5 => ray(corner[0] - (corner[1] - corner[0]), corner[1] - corner[0]),
            6 => ray(middle + (corner[1] - corner[0]), (corner[0] - corner[1]) + random.cube(1e-3)),
            7 => ray(corner[0], random.direction() * 1e-3),
            _ => ray(origin, Vec3::new(random.range(-1.0, 1.0), 0.0, random.range(-1e-6, 1e-6))),
        };
        match i % 29 {
            3 | 11 | 19 => (r.t_min, r.t_max) = (random.range(0.0, 0.5), random.range(0.4, 2.0)),
            5 => (r.t_min, r.t_max) = (1.0, 1.0),
            7 => r.direction = [0.0; 3],
            9 => r.origin[i % 3] = f32::NAN,
            13 => r.direction[i % 3] = f32::INFINITY,
            _ => {}
        }
        rays.push(r);
    }
    rays
}

/// Faulty rays are no business of the brute force: both forms answer a miss.
fn proper(ray: &Ray) -> bool {
    ray.origin.iter().chain(&ray.direction).all(|x| x.is_finite()) && ray.direction != [0.0; 3] && ray.t_min < ray.t_max
}

/// Corners of a hit triangle in scene space.
fn corners(objects: &[Object], hit: &Hit) -> [DVec3; 3] {
    let object = &objects[hit.instance as usize];
    let triangle = object.mesh.triangles[hit.triangle as usize];
    triangle.map(|v| object.place.transform_point3(object.mesh.positions[v as usize]).as_dvec3())
}

/// Where a hit lies by its weights.
fn point(objects: &[Object], hit: &Hit) -> DVec3 {
    let [a, b, c] = corners(objects, hit);
    let (u, v) = (f64::from(hit.u), f64::from(hit.v));
    (1.0 - u - v) * a + u * b + v * c
}

/// True where the brute force has no margin to give: the ray runs along the plane of the triangle, or begins on it.
fn edge_on(objects: &[Object], ray: &Ray, hit: &Hit) -> bool {
    if !hit.is_hit() {
        return false;
    }
    let [a, b, c] = corners(objects, hit);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let slope = normal.dot(Vec3::from(ray.direction).as_dvec3().normalize());
    slope.abs() < 1e-5 || point(objects, hit).distance(Vec3::from(ray.origin).as_dvec3()) < 1e-6
}

/// Rays on which the forms differ though the brute force leaves no doubt, and how many differ at all.
fn differences(objects: &[Object], rays: &[Ray], native: &[Hit], wgsl: &[Hit]) -> (usize, usize) {
    let (mut wrong, mut all) = (0, 0);
    for ((r, n), w) in rays.iter().zip(native).zip(wgsl) {
        let near = |scale: f32| (n.t - w.t).abs() <= 2e-5 * scale;
        let alike = n.is_hit() == w.is_hit() && (!n.is_hit() || near(n.t.abs().max(0.1)));
        // At the same `t` two triangles may meet: which of them is named is a matter of the last bit.
        let named = n.instance == w.instance && n.triangle == w.triangle;
        let placed = named && (!n.is_hit() || point(objects, n).distance(point(objects, w)) < 5e-5);
        if alike && placed {
            continue;
        }
        all += 1;
        let plain = !edge_on(objects, r, n) && !edge_on(objects, r, w);
        if !proper(r) || (plain && brute_force(objects, r).margin > 1e-3) {
            wrong += 1;
            if wrong < 4 {
                println!("{r:?}\n  native {n:?}\n  wgsl   {w:?}");
            }
        }
    }
    (wrong, all)
}

#[test]
fn closest_and_any_agree_on_nasty_rays() {
    let mut random = Random::new(11);
    let objects = objects(&mut random);
    let rays = nasty_rays(&objects, 20_011, &mut random);
    let (native, native_any, native_count) = answers(&tracer(Form::Native, &objects), &rays);
    let (wgsl, wgsl_any, wgsl_count) = answers(&tracer(Form::Wgsl, &objects), &rays);
    let (wrong, all) = differences(&objects, &rays, &native, &wgsl);
    println!("{all} of {} rays differ, {wrong} without a reason", rays.len());
    assert_eq!(wrong, 0);
    // Nearly half of the rays go through corners or along edges, where either neighbour may be named.
    assert!(all < rays.len() / 10, "{all} rays differ at edges");
    let hit = native.iter().filter(|h| h.is_hit()).count();
    assert!(hit > rays.len() / 4 && hit < rays.len() * 9 / 10, "{hit} hits: the rays test something");
    let mut doubtful = 0;
    for (((r, n), w), (native, wgsl)) in rays.iter().zip(&native_any).zip(&wgsl_any).zip(native.iter().zip(&wgsl)) {
        assert_eq!(*n, native.is_hit(), "native closest and any disagree: {r:?}");
        assert_eq!(*w, wgsl.is_hit(), "WGSL closest and any disagree: {r:?}");
        doubtful += usize::from(n != w);
    }
    assert!(doubtful < rays.len() / 100, "{doubtful} rays are occluded in one form only");
    assert!(wgsl.iter().all(|h| h.is_hit() || (h.t == f32::INFINITY && h.triangle == u32::MAX)));
    let usable = rays.iter().filter(|r| proper(r)).count() as u64;
    assert_eq!((native_count, wgsl_count), (2 * usable, 2 * usable), "faulty rays are not counted");
}

#[test]
fn a_moved_vertex_is_noticed() {
    // Negative control: the comparison above sees a triangle that is out of place by a twentieth.
    let mut random = Random::new(11);
    let mut objects = objects(&mut random);
    let rays = nasty_rays(&objects, 5_000, &mut random);
    let native = answers(&tracer(Form::Native, &objects), &rays).0;
    for p in &mut objects[1].mesh.positions {
        *p *= 1.05;
    }
    let wgsl = answers(&tracer(Form::Wgsl, &objects), &rays).0;
    let (wrong, _) = differences(&objects, &rays, &native, &wgsl);
    assert!(wrong > 50, "{wrong}");
}

#[test]
fn nothing_leaks_through_closed_meshes() {
    // From inside of closed surfaces every ray hits, also exactly through edges and corners.
    for (mesh, place) in [
        (cube(8), Affine3A::IDENTITY),
        (sphere(4, 0.0), Affine3A::from_scale(Vec3::new(-3.0, 1.0, 0.5))),
        (cube(5), Affine3A::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.7)),
        (sphere(3, 0.0), Affine3A::from_translation(Vec3::new(1000.0, -2000.0, 500.0))),
    ] {
        let objects = [Object { mesh, place }];
        let mesh = &objects[0].mesh;
        let mut random = Random::new(5);
        let mut rays = Vec::new();
        for i in 0..60_000 {
            let triangle = mesh.triangles[random.below(mesh.triangles.len())];
            let corner = triangle.map(|v| place.transform_point3(mesh.positions[v as usize]));
            let origin = place.transform_point3(if i % 2 == 0 { Vec3::ZERO } else { random.cube(0.2) });
            let target = if i % 3 == 0 { corner[0] } else { corner[0].lerp(corner[1], random.unit()) };
            rays.push(ray(origin, (target - origin) * random.range(0.1, 3.0)));
        }
        let (hits, any, _) = answers(&tracer(Form::Wgsl, &objects), &rays);
        let leaks = hits.iter().filter(|h| !h.is_hit()).count() + any.iter().filter(|a| !**a).count();
        assert_eq!(leaks, 0, "of {} rays", 2 * rays.len());
    }
}

fn open_square() -> Mesh {
    grid(4)
}

#[test]
fn an_open_surface_does_leak() {
    // Negative control of the leak test: with one triangle less, rays do get out.
    let mut mesh = cube(8);
    mesh.triangles.truncate(mesh.triangles.len() - 1);
    let objects = [Object { mesh, place: Affine3A::IDENTITY }];
    let mut random = Random::new(5);
    let rays: Vec<Ray> = (0..60_000).map(|_| ray(Vec3::ZERO, random.direction())).collect();
    let hits = answers(&tracer(Form::Wgsl, &objects), &rays).0;
    assert!(hits.iter().any(|h| !h.is_hit()));
}

#[test]
fn moving_an_instance_sends_the_top_level_only() {
    let gpu = device();
    let mesh = sphere(3, 0.1).blas();
    let at = |x: f32| TraceInstance::new(Affine3A::from_translation(Vec3::new(x, 0.0, -5.0)), mesh.clone());
    let mut tracer = Tracer::with_form(gpu, Form::Wgsl).unwrap();
    assert_eq!(tracer.set_scene(gpu, vec![at(0.0), at(3.0)]).unwrap(), ["meshes", "top level"]);
    assert_eq!(tracer.set_scene(gpu, vec![at(0.5), at(3.0)]).unwrap(), ["top level"]);
    let forward = [ray(Vec3::ZERO, Vec3::NEG_Z), ray(Vec3::new(1.7, 0.0, 0.0), Vec3::NEG_Z)];
    let hits = answers(&tracer, &forward).0;
    assert!(hits[0].is_hit() && !hits[1].is_hit());
    assert_eq!(tracer.set_scene(gpu, vec![at(0.5), at(1.7), at(9.0)]).unwrap(), ["top level"]);
    assert_eq!(answers(&tracer, &forward).0[1].instance, 1);
    tracer.set_scene(gpu, Vec::new()).unwrap();
    assert!(answers(&tracer, &forward).0.iter().all(|h| !h.is_hit()), "an empty scene is all misses");
    let other = TraceInstance::new(Affine3A::IDENTITY, open_square().blas());
    assert!(tracer.set_scene(gpu, vec![other]).unwrap().contains(&"meshes"));
}

#[test]
fn a_mesh_in_the_memory_of_another_is_sent() {
    let gpu = device();
    let placed = |mesh: &&Arc<Blas>| TraceInstance::new(Affine3A::IDENTITY, Arc::clone(mesh));
    let scene = |meshes: &[&Arc<Blas>]| meshes.iter().map(placed).collect::<Vec<_>>();
    let kept = Mesh { positions: vec![Vec3::X, Vec3::Y, Vec3::Z], triangles: vec![[0, 1, 2]] }.blas();
    let mut tracer = Tracer::with_form(gpu, Form::Wgsl).unwrap();
    let mut ball = sphere(1, 0.0);
    let mut mesh = ball.blas();
    let forward = [ray(Vec3::ZERO, Vec3::NEG_Z)];
    tracer.set_scene(gpu, scene(&[&kept, &mesh])).unwrap();
    assert!(answers(&tracer, &forward).0[0].t < 1.1);
    // Nothing is new in this scene, and no one holds the ball after it.
    tracer.set_scene(gpu, scene(&[&kept])).unwrap();
    ball.positions.iter_mut().for_each(|p| p.z -= 9.0);
    *Arc::get_mut(&mut mesh).expect("no one holds it") = Blas::build(&ball.positions, &ball.triangles);
    tracer.set_scene(gpu, scene(&[&kept, &mesh])).unwrap();
    let hit = answers(&tracer, &forward).0[0];
    assert!(hit.is_hit() && hit.t > 7.0, "{hit:?}");
}

#[test]
fn moving_an_instance_allocates_nothing() {
    // On a device of its own: the other tests allocate meanwhile.
    let gpu = Gpu::new("auto").unwrap();
    let mesh = sphere(3, 0.1).blas();
    let at = |x: f32| TraceInstance::new(Affine3A::from_translation(Vec3::new(x, 0.0, -5.0)), mesh.clone());
    let mut tracer = Tracer::with_form(&gpu, Form::Wgsl).unwrap();
    tracer.set_scene(&gpu, vec![at(0.0), at(3.0)]).unwrap();
    let before = gpu.allocated_bytes();
    tracer.set_scene(&gpu, vec![at(0.5), at(3.0)]).unwrap();
    assert_eq!(gpu.allocated_bytes(), before);
}

#[test]
fn both_forms_can_be_cancelled() {
    let gpu = device();
    let objects = [Object { mesh: sphere(5, 0.1), place: Affine3A::IDENTITY }];
    let mut random = Random::new(2);
    let rays: Vec<Ray> = (0..1 << 19).map(|_| ray(random.cube(2.0), random.direction())).collect();
    let list = gpu.upload("rays", &rays).unwrap();
    let hits = gpu.buffer::<Hit>("hits", rays.len(), Usage::Storage).unwrap();
    for form in [Form::Native, Form::Wgsl] {
        let tracer = tracer(form, &objects);
        let asked = std::sync::atomic::AtomicUsize::new(0);
        let stop = || asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) >= 3;
        let mut recorder = gpu.record(&stop).unwrap();
        let mut ended = Ok(0);
        for _ in 0..20 {
            ended = tracer.closest(&mut recorder, "trace", &list, &hits, 0..rays.len());
            if ended.is_err() {
                break;
            }
        }
        assert_eq!(ended, Err(Error::Cancelled), "{form:?}");
    }
    // The device goes on afterwards.
    assert_eq!(answers(&tracer(Form::Wgsl, &objects), &rays[..100]).0.len(), 100);
}

#[test]
fn lists_are_traced_from_any_tile() {
    let gpu = device();
    let objects = [Object { mesh: sphere(3, 0.1), place: Affine3A::IDENTITY }];
    let mut random = Random::new(9);
    let rays: Vec<Ray> = (0..10_000).map(|_| ray(random.cube(2.0), random.direction())).collect();
    let whole = answers(&tracer(Form::Wgsl, &objects), &rays).0;
    let list = gpu.upload("rays", &rays).unwrap();
    for form in [Form::Native, Form::Wgsl] {
        let hits = gpu.upload("hits", &vec![Hit { t: -1.0, ..Hit::MISS }; rays.len()]).unwrap();
        let mut recorder = gpu.record(never()).unwrap();
        tracer(form, &objects).closest(&mut recorder, "trace", &list, &hits, 2048..9_000).unwrap();
        recorder.finish().unwrap();
        let part = gpu.read(&hits).unwrap();
        assert!(part[..2048].iter().chain(&part[9_000..]).all(|h| h.t == -1.0), "{form:?} wrote outside its range");
        let same = part[2048..9_000].iter().zip(&whole[2048..9_000]).filter(|(a, b)| a.instance == b.instance).count();
        assert!(same > 6_940, "{form:?} {same}");
    }
}

#[test]
fn twins_have_the_same_layout() {
    use miplight::gpu::layout::{same, shader_layout};
    use miplight::host_layout;
    use miplight::passes::visibility::map_rays::MapParams;
    use miplight::passes::visibility::shadow::ShadowParams;
    use miplight::passes::visibility::trace_wgsl::{PlacedRecord, TopLevel, TriangleRecord};
    use miplight::passes::visibility::voxelize::{VoxelizeParams, Voxels};
    use miplight::scene::bvh::Node2;
    let twin = |host: &miplight::gpu::layout::Layout, stem: &str, name: &str| {
        same(host, &shader_layout(stem, name).unwrap()).unwrap_or_else(|e| panic!("{e}"));
    };
    twin(&host_layout!(Ray { origin, t_min, direction, t_max }), "common/ray", "Ray");
    twin(&host_layout!(Hit { t, u, v, instance, triangle }), "common/ray", "Hit");
    let receiver = host_layout!(Receiver { origin, pattern, normal_geo, flags, normal_shade, pixel });
    twin(&receiver, "common/ray", "Receiver");
    twin(&host_layout!(Node2 { lo, first, hi, count }), "common/bvh", "Node");
    twin(&host_layout!(TriangleRecord { a, id, b, pad_b, c, pad_c }), "common/bvh", "Triangle");
    let instance = host_layout!(PlacedRecord { row_x, node, row_y, triangle, row_z, id, center, reach });
    twin(&instance, "common/bvh", "Placed");
    twin(&host_layout!(TopLevel { nodes }), "common/bvh", "TopLevel");
    let params = host_layout!(ShadowParams {
        light_normal,
        two_sided,
        cone_axis,
        cos_cutoff,
        receivers,
        strata,
        patterns,
        words
    });
    twin(&params, "common/shadow_query", "ShadowParams");
    let voxels = host_layout!(Voxels {
        eye,
        columns,
        right,
        rows,
        up,
        words,
        backward,
        near,
        scale,
        center,
        far,
        slices_per_depth,
        bias,
        steps
    });
    twin(&voxels, "common/voxels", "Voxels");
    let voxelize = host_layout!(VoxelizeParams { first, triangles, instances, blocks });
    twin(&voxelize, "passes/visibility/voxelize", "VoxelizeParams");
    let map = host_layout!(MapParams { normal, resolution, sides, first, samples, offset, tan_half, pad0, pad1, pad2 });
    twin(&map, "common/shadow_map", "MapParams");
}
