//! The two forms of the proofs: both are right, and they prove nearly the same.
mod trace_common;
use glam::{Affine3A, Quat, Vec3};
use miplight::gpu::{Gpu, never};
use miplight::passes::refine::light_bounds::flags;
use miplight::passes::visibility::trace::{Form, Tracer};
use miplight::passes::visibility::trace_native::TraceScene;
use miplight::passes::{GBuffer, View};
use trace_common::tiles::{Image, Light, SIZE, TILES, lights, lit_side_down, look};
use trace_common::{Object, Random, cube, grid, instances, soup, sphere};

fn placed(mesh: trace_common::Mesh, scale: Vec3, turn: f32, at: Vec3) -> Object {
    let turn = Quat::from_axis_angle(Vec3::new(0.3, 1.0, 0.2).normalize(), turn);
    Object { mesh, place: Affine3A::from_scale_rotation_translation(scale, turn, at) }
}

/// A room with a box, a scan, a square that hides the light, and some loose triangles.
fn room(random: &mut Random, light: &Light) -> Vec<Object> {
    let lying = Affine3A::from_rotation_x(std::f32::consts::FRAC_PI_2) * Affine3A::from_scale(Vec3::new(4.0, 4.0, 1.0));
    let mut objects = vec![
        Object { mesh: cube(1), place: Affine3A::from_scale(Vec3::splat(5.0)) },
        Object { mesh: grid(1), place: Affine3A::from_translation(Vec3::new(0.5, -2.0, 0.0)) * lying },
        placed(cube(1), Vec3::splat(0.8), 0.4, Vec3::new(-2.0, -4.2, 2.0)),
        placed(sphere(4, 0.05), Vec3::splat(1.0), 0.2, Vec3::new(-3.0, -4.0, -2.0)),
        placed(soup(6, 0.2, random), Vec3::splat(1.0), 0.9, Vec3::new(-2.0, 1.0, 3.0)),
    ];
    if light.u != Vec3::ZERO {
        objects.push(light.object());
    }
    objects
}

fn prove(form: Form, objects: &[Object], image: &Image, light: &Light) -> Vec<u32> {
    let gpu = &Gpu::new("auto").unwrap();
    let mut tracer = Tracer::with_form(gpu, form).unwrap();
    tracer.set_scene(gpu, instances(objects)).unwrap();
    let gbuffer = GBuffer {
        position: gpu.upload("g_position", &image.position).unwrap(),
        normal: gpu.upload("g_normal", &image.normal).unwrap(),
        geometric: gpu.upload("g_geometric", &image.geometric).unwrap(),
        albedo: gpu.upload("g_albedo", &image.normal).unwrap(),
    };
    let bounds = gpu.upload("tile_bounds", &image.bounds).unwrap();
    let words = gpu.upload("tile_flags", &image.flags).unwrap();
    let size = SIZE as u32;
    let view = View { width: size, height: size, tiled: size * size, ..bytemuck::Zeroable::zeroed() };
    let mut recorder = gpu.record(never()).unwrap();
    tracer.prove(&mut recorder, "prove", &light.frame(), &bounds, &words, &gbuffer, &view).unwrap();
    let times = recorder.finish().unwrap();
    assert!(times.of("prove") > 0.0);
    gpu.read(&words).unwrap()
}

#[test]
fn both_forms_are_right_and_prove_nearly_the_same() {
    let mut random = Random::new(31);
    for light in lights().into_iter().map(lit_side_down) {
        let objects = room(&mut random, &light);
        let scene = TraceScene::new(instances(&objects));
        let image = look(&scene, &objects, Vec3::new(3.5, 1.0, -4.5), Vec3::new(-1.0, -4.0, 1.0), &light);
        let found = [Form::Native, Form::Wgsl].map(|form| prove(form, &objects, &image, &light));
        assert_eq!(found[0], image.prove(&scene, &light), "the border passes all on");
        for flags in &found {
            let [wrong, rays] = image.faults(&scene, &light, flags, &mut random);
            println!("{:?} facing, lit, dark; {wrong} of {rays} rays are against it", image.count(flags));
            assert_eq!(wrong, 0);
            let kept = flags.iter().zip(&image.flags).all(|(f, before)| f & 255 == *before);
            assert!(kept, "other flags stay");
        }
        let both = flags::LIT | flags::DARK;
        let differ = found[0].iter().zip(&found[1]).filter(|(a, b)| (*a ^ *b) & both != 0).count();
        let [facing, lit, _] = image.count(&found[1]);
        assert!(differ * 20 <= TILES * TILES, "{differ} tiles differ");
        assert!(lit * 3 > facing, "{lit} of {facing}");
    }
}
