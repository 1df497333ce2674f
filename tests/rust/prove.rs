//! Proofs about tiles: rays that they speak for agree, they are found where they should be, and a wire undoes them.
mod trace_common;
use glam::{Affine3A, Quat, Vec3};
use miplight::passes::visibility::trace_native::{SimdWidth, TraceScene};
use trace_common::tiles::{Light, lights, lit_side_down, look};
use trace_common::{Mesh, Object, Random, cube, grid, instances, soup, sphere};

/// A room from -5 to 5, and what stands in it.
fn room(things: Vec<Object>) -> Vec<Object> {
    let mut objects = vec![Object { mesh: cube(1), place: Affine3A::from_scale(Vec3::splat(5.0)) }];
    objects.extend(things);
    objects
}

fn placed(mesh: Mesh, scale: Vec3, turn: f32, at: Vec3) -> Object {
    let turn = Quat::from_axis_angle(Vec3::new(0.3, 1.0, 0.2).normalize(), turn);
    Object { mesh, place: Affine3A::from_scale_rotation_translation(scale, turn, at) }
}

/// Slats, a wire, a table, boxes, a soup, a scan: everything between.
fn cluttered(random: &mut Random) -> Vec<Object> {
    let mut things: Vec<Object> = (0..6)
        .map(|i| placed(cube(1), Vec3::new(1.5, 0.01, 0.1), 0.3, Vec3::new(-3.0, 1.0, -2.0 + 0.4 * i as f32)))
        .collect();
    things.push(placed(cube(1), Vec3::new(3.0, 0.002, 0.002), 0.7, Vec3::new(1.0, 0.0, 0.0)));
    things.push(placed(cube(1), Vec3::new(1.2, 0.05, 0.9), 0.0, Vec3::new(2.5, -3.0, 2.0)));
    things.push(placed(cube(2), Vec3::splat(0.8), 0.5, Vec3::new(-2.5, -4.2, 2.5)));
    things.push(placed(soup(40, 0.3, random), Vec3::splat(1.0), 1.0, Vec3::new(-2.0, 2.0, 2.0)));
    things.push(placed(sphere(5, 0.05), Vec3::splat(1.2), 0.2, Vec3::new(0.0, -3.5, 0.0)));
    things
}

fn scene(objects: &[Object], light: &Light) -> TraceScene {
    let mut placed = instances(objects);
    if light.u != Vec3::ZERO {
        placed.extend(instances(&[light.object()]));
    }
    TraceScene::new(placed)
}

/// A single square above the floor, of two triangles.
fn table(at: Vec3, size: f32) -> Object {
    let lying = Affine3A::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let place = Affine3A::from_translation(at) * lying * Affine3A::from_scale(Vec3::new(size, size, 1.0));
    Object { mesh: grid(1), place }
}

/// The same `scale` times as large.
fn grown(objects: &mut [Object], light: &mut Light, scale: f32) {
    for object in objects {
        object.place = Affine3A::from_scale(Vec3::splat(scale)) * object.place;
    }
    (light.corner, light.u, light.v) = (light.corner * scale, light.u * scale, light.v * scale);
}

#[test]
fn no_ray_belies_a_proof() {
    let mut random = Random::new(21);
    let [mut facing, mut lit, mut dark] = [0; 3];
    for (i, mut light) in lights().into_iter().map(lit_side_down).enumerate() {
        let fine_soup = placed(soup(300, 0.2, &mut random), Vec3::splat(2.0), 0.4, Vec3::ZERO);
        let square = table(Vec3::new(-4.0, 0.0, -3.0), 5.0);
        for (j, things) in [cluttered(&mut random), vec![fine_soup], vec![square]].into_iter().enumerate() {
            let (mut objects, scale) = (room(things), [1.0, 300.0, 0.01][(i + j) % 3]);
            grown(&mut objects, &mut light, scale);
            let scene = scene(&objects, &light);
            objects.push(light.object());
            for eye in [Vec3::new(0.0, 0.0, -4.9), Vec3::new(4.0, 3.0, 4.0), Vec3::new(-4.5, -4.0, 1.0)] {
                let image = look(&scene, &objects, eye * scale, Vec3::new(0.3, -1.5, 0.2) * scale, &light);
                let found = image.prove(&scene, &light);
                let [wrong, rays] = image.faults(&scene, &light, &found, &mut random);
                let [f, l, d] = image.count(&found);
                println!("{f} facing, {l} lit, {d} dark; {wrong} of {rays} rays are against it");
                assert_eq!(wrong, 0, "of {rays}");
                [facing, lit, dark] = [facing + f, lit + l, dark + d];
                // Negative control: what the tile across the image has found is no proof here.
                let turned: Vec<u32> = found.iter().rev().copied().collect();
                let [wrong, _] = image.faults(&scene, &light, &turned, &mut random);
                assert!(wrong > 0 || l + d == 0, "rays would not tell");
            }
            grown(&mut [], &mut light, 1.0 / scale);
        }
    }
    println!("{facing} facing, {lit} lit, {dark} dark");
    assert!(lit > facing / 4 && dark > facing / 100, "{facing} facing, {lit} lit, {dark} dark");
}

#[test]
fn every_width_proves_the_same() {
    let mut random = Random::new(22);
    let light = lit_side_down(lights()[0]);
    let objects = room(cluttered(&mut random));
    let mut scene = scene(&objects, &light);
    let mut visible = objects;
    visible.push(light.object());
    let image = look(&scene, &visible, Vec3::new(4.0, 3.0, 4.0), Vec3::ZERO, &light);
    let mut all = Vec::new();
    for width in SimdWidth::available() {
        scene = scene.with_width(width).unwrap();
        all.push(image.prove(&scene, &light));
    }
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn bare_surfaces_are_proven_and_a_wire_undoes_it() {
    for n in [1, 40] {
        for light in lights().into_iter().map(lit_side_down) {
            let mut objects = vec![Object { mesh: cube(n), place: Affine3A::from_scale(Vec3::splat(5.0)) }];
            let bare = scene(&objects, &light);
            objects.push(light.object());
            let (eye, at) = (Vec3::new(3.0, 2.0, -4.0), Vec3::new(-3.0, -5.0, 3.0));
            let image = look(&bare, &objects, eye, at, &light);
            let found = image.prove(&bare, &light);
            let [facing, lit, _] = image.count(&found);
            println!("{n}: {lit} of {facing} lit");
            // A light in the middle of the room has tiles on both of its sides; where walls of small triangles meet a
            // tile there may be too many of them.
            let least = if n == 1 { 0.9 } else { 0.6 };
            assert!(lit as f64 >= least * facing as f64 && facing > 50, "{lit} of {facing}");
            // Negative control: a wire over the floor.
            objects.pop();
            objects.push(placed(cube(1), Vec3::new(4.0, 0.003, 0.003), 0.0, Vec3::new(0.0, -4.0, 0.0)));
            let wired = scene(&objects, &light);
            let [_, less, _] = image.count(&image.prove(&wired, &light));
            assert!(less < lit, "{less} of {lit}");
        }
    }
}

#[test]
fn boxes_tables_and_scans_leave_most_of_a_room_proven() {
    let light = lit_side_down(lights()[0]);
    let cases = [
        ("box", vec![placed(cube(1), Vec3::splat(1.0), 0.3, Vec3::new(0.0, -4.0, 0.0))], 0.5, 0.0),
        ("table", vec![table(Vec3::new(-4.0, -3.0, -4.0), 7.0)], 0.3, 0.02),
        ("scan", vec![placed(sphere(5, 0.03), Vec3::splat(1.5), 0.0, Vec3::new(0.0, -3.0, 0.0))], 0.5, 0.0),
    ];
    for (name, things, least_lit, least_dark) in cases {
        let objects = room(things);
        let scene = scene(&objects, &light);
        let mut visible = objects;
        visible.push(light.object());
        let image = look(&scene, &visible, Vec3::new(0.0, 2.0, -4.9), Vec3::new(0.0, -2.5, 0.0), &light);
        let [facing, lit, dark] = image.count(&image.prove(&scene, &light)).map(|n| n as f64);
        println!("{name}: {facing} facing, {lit} lit, {dark} dark");
        assert!(lit >= least_lit * facing && dark >= least_dark * facing, "{name}: {facing} {lit} {dark}");
    }
}
