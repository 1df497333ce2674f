//! The light's side of virtual lights from a scene to its lists: what a closed box reflects of a spot and of an area light.

use std::sync::Arc;

use bytemuck::Zeroable;
use glam::{DMat4, DVec3, Vec3};
use miplight::error::Error;
use miplight::gpu::{Gpu, Resources, never};
use miplight::passes::lights::virtual_light::{Rsm, VirtualLight, VirtualLights, level_first};
use miplight::passes::lights::{rsm_rays, rsm_tree, vpl_clusters, vpl_grid, vpl_importance};
use miplight::passes::lpv::points::Kept;
use miplight::passes::scene_buffers::SceneBuffers;
use miplight::passes::visibility::placed::PlacedScene;
use miplight::passes::visibility::trace::{Form, Tracer};
use miplight::passes::{Context, View};
use miplight::scene::light::{AreaLight, Radiance, SpotLight};
use miplight::scene::mesh::{Mesh, MeshInput};
use miplight::scene::prepare::Prepared;
use miplight::scene::snapshot::{Instance, Snapshot};
use miplight::settings::{Settings, Value};

const ALBEDO: f32 = 0.5;

/// A closed cube of half-width 2.
fn cube() -> Instance {
    let positions =
        (0..8).map(|k| DVec3::new(f64::from(k >> 2 & 1), f64::from(k >> 1 & 1), f64::from(k & 1)) * 4.0 - 2.0);
    let quads: [[u32; 4]; 6] = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let input = MeshInput { positions: positions.collect(), triangles, ..Default::default() };
    Instance {
        name: "cube".into(),
        mesh: Arc::new(Mesh::new("cube", input).expect("a cube")),
        world_from_object: DMat4::IDENTITY,
        smooth: false,
        albedo: Vec3::splat(ALBEDO),
        texture: None,
        vertex_colors: false,
        lobe: [0.0; 4],
    }
}

fn area(radiance: f32, two_sided: bool) -> AreaLight {
    AreaLight {
        name: format!("area {radiance}"),
        corner: DVec3::new(-0.5, 1.0, -0.25),
        edge_u: DVec3::X,
        edge_v: DVec3::Z * 0.5,
        radiance: Radiance::Constant(Vec3::new(radiance, 2.0 * radiance, 0.0)),
        two_sided,
        visible: false,
        linear_filter: false,
    }
}

fn spot() -> SpotLight {
    SpotLight {
        name: "spot".into(),
        position: DVec3::new(0.3, 0.2, -0.5),
        target: DVec3::new(0.5, -2.0, 0.0),
        intensity: Vec3::new(5.0, 3.0, 1.0),
        cutoff_degrees: 40.0,
    }
}

/// A dark light, one that shines from both sides, and a spot: three maps.
fn scene() -> Snapshot {
    Snapshot {
        instances: vec![cube()],
        area_lights: vec![area(0.0, false), area(3.0, true)],
        spot_lights: vec![spot()],
    }
}

/// Flux that the box reflects in all: of each map.
fn expected() -> [[f64; 3]; 3] {
    let side = std::f64::consts::PI * f64::from(ALBEDO) * 0.5;
    let cone = std::f64::consts::TAU * (1.0 - 40_f64.to_radians().cos()) * f64::from(ALBEDO);
    let of_area = [3.0 * side, 6.0 * side, 0.0];
    [of_area, of_area, [5.0 * cone, 3.0 * cone, cone]]
}

fn settings(changes: &[(&'static str, Value)]) -> Settings {
    let small = [("rsm_resolution", Value::Int(64)), ("vpls", Value::Int(64)), ("coarsest_vpls", Value::Int(16))];
    Settings::new(small.into_iter().chain(changes.iter().cloned())).expect("settings")
}

fn with_context<R>(
    form: Form,
    settings: &Settings,
    snapshot: &Snapshot,
    work: impl FnOnce(&mut Context<'_, '_>) -> R,
) -> (Gpu, R) {
    let gpu = Gpu::new("auto").expect("these tests need an adapter; Mesa's llvmpipe will do");
    let prepared = Prepared::new(snapshot);
    let mut tracer = Tracer::with_form(&gpu, form).expect("tracer");
    PlacedScene::default().sync(&mut tracer, &gpu, &prepared).expect("trees");
    let mut scene = SceneBuffers::new();
    scene.sync(&gpu, &prepared).expect("scene");
    let mut resources = Resources::new(&gpu);
    let mut recorder = gpu.record(never()).expect("recorder");
    let mut context = Context {
        recorder: &mut recorder,
        resources: &mut resources,
        scene: &scene,
        tracer: &tracer,
        prepared: &prepared,
        settings,
        view: View::zeroed(),
        volumes: &mut Kept::default(),
        rays: 0,
    };
    let result = work(&mut context);
    recorder.finish().expect("frame");
    (gpu, result)
}

/// Sums of flux by map; every one within 0.5 % of what the closed box must reflect.
fn assert_flux(lights: &[VirtualLight], only_together: bool) {
    let mut sums = [[0.0; 3]; 3];
    for light in lights {
        let map = (light.extent >> 16) as usize;
        (0..3).for_each(|c| sums[map][c] += f64::from(light.flux[c]));
    }
    for (sum, wanted) in sums.iter().zip(expected()) {
        let all = (sum.iter().sum::<f64>(), wanted.iter().sum::<f64>());
        assert!((all.0 - all.1).abs() < 0.005 * all.1, "{all:?}");
        if !only_together {
            (0..3).for_each(|c| assert!((sum[c] - wanted[c]).abs() <= 0.005 * wanted[c], "{sum:?} {wanted:?}"));
        }
    }
}

fn read(gpu: &Gpu, list: &VirtualLights) -> Vec<VirtualLight> {
    let lights = gpu.read(&list.lights).expect("lights");
    assert_eq!(lights.len(), list.count);
    lights
}

#[test]
fn every_list_has_all_flux_of_a_closed_box() {
    let settings = settings(&[]);
    for form in [Form::Native, Form::Wgsl] {
        let (gpu, (rsm, tree, clusters, rays)) = with_context(form, &settings, &scene(), |context| {
            let rsm = rsm_rays::record(context).expect("maps");
            let tree = rsm_tree::record(context, &rsm).expect("tree");
            let clusters = vpl_clusters::record(context, &rsm, &tree).expect("clusters");
            (rsm, tree, clusters, context.rays)
        });
        assert_eq!(rsm.maps.len(), 3, "the dark light has none");
        assert_eq!(rsm.maps[0].axis, rsm.maps[1].axis.map(|x| -x));
        assert_eq!([rsm.maps[0].tiles, rsm.maps[2].tiles], [4, 1]);
        // of the spot's frustum four parts in π lie in the cone
        let asked = (2.0 + std::f64::consts::FRAC_PI_4) * 64.0 * 64.0;
        assert!(form == Form::Wgsl || (rays as f64 - asked).abs() < 0.03 * asked, "{rays} rays, not {asked}");
        let nodes = gpu.read(&tree.nodes).expect("nodes");
        for level in 0..=6 {
            assert_flux(&nodes[level_first(level, 3)..level_first(level + 1, 3)], false);
        }
        let clusters = read(&gpu, &clusters);
        assert_flux(&clusters, false);
        assert!(clusters.len() > 3 * 16 / 2, "{}", clusters.len());
        assert!(clusters.iter().all(|light| light.flux.iter().sum::<f32>() > 0.0 && light.radius > 0.0));
    }
}

#[test]
fn grids_and_drawn_lights_have_all_flux() {
    let settings = settings(&[("vpls", Value::Int(50))]);
    let (gpu, list) = with_context(Form::Native, &settings, &scene(), |context| {
        let rsm = rsm_rays::record(context).expect("maps");
        vpl_grid::record(context, &rsm).expect("grid")
    });
    assert_eq!(list.count, 2 * 8 * 8 + 8 * 8);
    assert_flux(&read(&gpu, &list), false);
    let (gpu, list) = with_context(Form::Native, &settings, &scene(), |context| {
        let rsm: Rsm = rsm_rays::record(context).expect("maps");
        let tree = rsm_tree::record(context, &rsm).expect("tree");
        vpl_importance::record(context, &rsm, &tree).expect("lights")
    });
    assert_eq!(list.count, 3 * 50);
    assert_flux(&read(&gpu, &list), true);
}

#[test]
fn an_equal_solid_angle_is_the_frustum_s_share() {
    let settings = settings(&[("rsm_solid_angle", Value::Text("equal".into()))]);
    let (_, rsm) = with_context(Form::Native, &settings, &scene(), |context| rsm_rays::record(context).expect("maps"));
    let t2 = 40_f64.to_radians().tan().powi(2);
    let share = 4.0 * (t2 / (1.0 + t2)).asin() / (64.0 * 64.0);
    assert!((f64::from(rsm.maps[2].equal) / share - 1.0).abs() < 1e-6, "{} is not {share}", rsm.maps[2].equal);
    assert_eq!([rsm.maps[0].equal, rsm.maps[1].equal], [0.0; 2]);
}

#[test]
fn maps_that_do_not_fit_are_refused_with_numbers() {
    let settings = settings(&[("rsm_resolution", Value::Int(1024))]);
    let bytes = 3 * 1024 * 1024 * 48;
    rsm_rays::check(&settings, &scene(), bytes).expect("they just fit");
    let refused = rsm_rays::check(&settings, &scene(), bytes - 1);
    let Err(Error::Settings(text)) = refused else { panic!("{refused:?}") };
    assert!(text.contains("rsm_resolution=1024") && text.contains(&bytes.to_string()), "{text}");
    let changes = [("rsm_resolution", Value::Int(1024)), ("vpl_pattern", Value::Text("importance".into()))];
    let settings = Settings::new(changes).expect("settings");
    let tree = 3 * (4 * 1024 * 1024 - 1) / 3 * 64;
    rsm_rays::check(&settings, &scene(), tree).expect("the tree just fits");
    assert!(rsm_rays::check(&settings, &scene(), tree - 1).is_err());
}

#[test]
fn without_lights_there_is_nothing() {
    let empty = Snapshot { instances: vec![cube()], ..Default::default() };
    with_context(Form::Native, &settings(&[]), &empty, |context| {
        let rsm = rsm_rays::record(context).expect("maps");
        let tree = rsm_tree::record(context, &rsm).expect("tree");
        assert_eq!(rsm.maps.len(), 0);
        assert_eq!(vpl_grid::record(context, &rsm).expect("grid").count, 0);
        assert_eq!(vpl_importance::record(context, &rsm, &tree).expect("lights").count, 0);
        assert_eq!(vpl_clusters::record(context, &rsm, &tree).expect("clusters").count, 0);
    });
}
