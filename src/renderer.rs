//! The frame as an ordered list of passes, and what is kept between frames.

mod read;
mod read_levels;
mod read_lights;
mod read_volume;

use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Instant;

use crate::error::{Error, Result};
use crate::frame::{FrameInfo, Stats};
use crate::gpu::{AdapterFacts, Buffer, Cancel, Gpu, Recorder, Resources, Times};
use crate::passes::composite::composite::{self, Images};
use crate::passes::composite::downsample;
use crate::passes::gather::Direct;
use crate::passes::gather::levels::Looked;
use crate::passes::geometry::{gbuffer, primary_rays};
use crate::passes::indirect::{Evaluations, Indirect};
use crate::passes::lights::virtual_light::{Rsm, VirtualLights};
use crate::passes::lpv::Propagated;
use crate::passes::lpv::nested;
use crate::passes::lpv::points::Kept as KeptVolumes;
use crate::passes::scene_buffers::SceneBuffers;
use crate::passes::visibility::Hit;
use crate::passes::visibility::occlusion;
use crate::passes::visibility::placed::PlacedScene;
use crate::passes::visibility::trace::{Form, Tracer};
use crate::passes::{Context, GBuffer, View, gather, indirect, lobes, lpv};
use crate::plan::{COMPOSITE, DIRECT, DOWNSAMPLE, FRAGMENTS, GEOMETRY, IRRADIANCE, Plan, SceneFacts, Valid, plan};
use crate::scene::camera::Camera;
use crate::scene::prepare::Prepared;
use crate::scene::snapshot::Snapshot;
use crate::settings::Settings;

/// Primary rays that are traced at once: about 0.1 s of work for two cores, and more for a GPU.
const PRIMARY_RAYS_NATIVE: usize = 1 << 19;
const PRIMARY_RAYS_GPU: usize = 1 << 21;

/// What the G-buffer's albedo and normals are read from; sent anew, it is made anew.
const SURFACE_PARTS: [&str; 3] = ["geometry", "textures", "instances"];

/// A device with everything that is kept between frames; shared by threads, one frame at a time.
pub struct Renderer {
    gpu: Gpu,
    state: Mutex<State>,
}

struct State {
    resources: Resources,
    scene: SceneBuffers,
    tracer: Tracer,
    placed: PlacedScene,
    volumes: KeptVolumes,
    generation: u64,
    /// What the G-buffer of the last frame was made of.
    seen: Option<(View, u64)>,
    kept: Option<Kept>,
}

/// What the last frame left on the device.
struct Kept {
    view: View,
    anchor: glam::DVec3,
    gbuffer: GBuffer,
    /// What its pixels see, once someone asked.
    kinds: Mutex<Option<Arc<Vec<u32>>>>,
    images: Images,
    irradiance: [Option<Buffer<[f32; 4]>>; 2],
    /// Level and reason of each pixel's fragment, unless every fragment is a pixel.
    levels: Option<[Buffer<u32>; 2]>,
    /// The same of the lobes' fragments.
    specular_levels: Option<[Buffer<u32>; 2]>,
    /// The same of the fragments of indirect light.
    indirect_levels: Option<[Buffer<u32>; 2]>,
    /// Radiance that lobes reflect, internal pixels.
    specular: Option<Buffer<[f32; 4]>>,
    /// What incremental refinement looked at.
    looked: Option<Looked>,
    /// Where lights shine, and the list of virtual lights, where indirect light comes from them.
    virtual_lights: Option<(Rsm, Option<VirtualLights>)>,
    /// The volume that indirect light went through.
    volume: Option<Propagated>,
}

impl Kept {
    fn of(
        context: &Context<'_, '_>,
        gbuffer: GBuffer,
        images: Images,
        direct: Option<Direct>,
        indirect: Option<Indirect>,
    ) -> Self {
        let (levels, looked) = direct.as_ref().map_or((None, None), |d| (d.levels.clone(), d.looked.clone()));
        let lobes = direct.as_ref().map_or((None, None), |d| (d.specular_levels.clone(), d.specular.clone()));
        let bounced = indirect.as_ref().map_or((None, None), |i| (i.levels.clone(), i.virtual_lights.clone()));
        let volume = indirect.as_ref().and_then(|i| i.volume.clone());
        Self {
            view: context.view,
            anchor: context.prepared.anchor,
            gbuffer,
            kinds: Mutex::default(),
            images,
            irradiance: [direct.map(|d| d.irradiance), indirect.map(|i| i.irradiance)],
            levels,
            specular_levels: lobes.0,
            indirect_levels: bounced.0,
            specular: lobes.1,
            looked,
            virtual_lights: bounced.1,
            volume,
        }
    }

    /// Samples beyond the fragments.
    fn extra_samples(&self, gpu: &Gpu) -> Result<u64> {
        let extras = self.looked.as_ref().and_then(|looked| looked.extras.as_ref());
        Ok(extras.map(|extras| gpu.read(&extras.count)).transpose()?.map_or(0, |count| u64::from(count[0])))
    }

    /// Texels of a level that incremental refinement looked at.
    fn nodes(&self, level: u32) -> u64 {
        let levels = self.looked.iter().flat_map(|looked| &looked.nodes.levels);
        levels.filter(|held| held.level == level).map(|held| held.count as u64).sum()
    }
}

impl Renderer {
    /// Opens an adapter: "auto", "gpu", "cpu" or a part of its name. `form` of the trace: what suits the adapter, unless
    /// given.
    ///
    /// # Errors
    /// `Device` when none fits.
    pub fn new(adapter: &str, form: Option<Form>) -> Result<Self> {
        let gpu = Gpu::new(adapter)?;
        let tracer = match form {
            Some(form) => Tracer::with_form(&gpu, form)?,
            None => Tracer::new(&gpu)?,
        };
        let state = State {
            resources: Resources::new(&gpu),
            scene: SceneBuffers::new(),
            tracer,
            placed: PlacedScene::default(),
            volumes: KeptVolumes::default(),
            generation: 0,
            seen: None,
            kept: None,
        };
        Ok(Self { gpu, state: Mutex::new(state) })
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &AdapterFacts {
        self.gpu.facts()
    }

    /// Its limits, by name.
    pub fn limits(&self) -> Vec<(&'static str, u64)> {
        self.gpu.limits_report()
    }

    /// "native" or "wgsl".
    pub fn trace_form(&self) -> &'static str {
        if self.lock().tracer.native() { "native" } else { "wgsl" }
    }

    /// Gives everything on the device back.
    pub fn close(&self) {
        let mut state = self.lock();
        state.kept = None;
        state.seen = None;
        state.generation += 1;
        state.resources = Resources::new(&self.gpu);
        state.scene = SceneBuffers::new();
        state.volumes = KeptVolumes::default();
        self.gpu.close();
    }

    /// A frame that failed half-way leaves no state that the next one could trip over, so poison does not matter.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// The passes of a first frame.
    ///
    /// # Errors
    /// `Scene`, `Device` as [`Renderer::render`].
    pub fn plan(&self, snapshot: &Snapshot, camera: &Camera, settings: &Settings) -> Result<Plan> {
        self.check(snapshot, camera, settings)?;
        Ok(plan(SceneFacts::of(snapshot), settings, Valid::default()))
    }

    fn check(&self, snapshot: &Snapshot, camera: &Camera, settings: &Settings) -> Result<()> {
        self.gpu.check()?;
        snapshot.check()?;
        camera.check()?;
        occlusion::check(snapshot, camera, settings, &self.gpu)?;
        lobes::check(settings)?;
        indirect::check(snapshot, settings, &self.gpu)?;
        lpv::check(settings, &self.gpu)?;
        let factor = u64::from(settings.int("supersample"));
        let pixels = u64::from(camera.width) * u64::from(camera.height) * factor * factor;
        let largest = self.gpu.limits().max_storage_buffer_binding_size.min(self.gpu.limits().max_buffer_size) / 16;
        if pixels > largest {
            return Err(Error::Scene(format!(
                "image size {} x {} with supersample {factor} has {pixels} internal pixels; this adapter holds {} \
                 (max_storage_buffer_binding_size)",
                camera.width, camera.height, largest
            )));
        }
        Ok(())
    }

    /// Renders a frame; its images stay on the device.
    ///
    /// # Errors
    /// `Scene` for what cannot be rendered, `Settings` for unknown names in `keep`, `Device`, `Shader`, and
    /// `Cancelled` when `cancel` said so.
    pub fn render(
        &self,
        snapshot: &Snapshot,
        camera: &Camera,
        settings: &Settings,
        keep: &[String],
        cancel: Cancel<'_>,
    ) -> Result<FrameInfo> {
        let started = Instant::now();
        self.check(snapshot, camera, settings)?;
        read::check_asked(keep, settings)?;
        let mut state = self.lock();
        state.generation += 1;
        state.kept = None;
        let supersample = settings.int("supersample");
        let prepared = Prepared::new(snapshot);
        let view = View::new(&camera.supersampled(supersample), prepared.anchor);
        let mut recorder = self.gpu.record(cancel)?;
        // Taken: if this frame fails half-way, the next one trusts nothing.
        let seen = state.seen.take();
        let rebuilt = recorder.host("upload", |gpu, _| state.sync(gpu, &prepared))?;
        let repainted = rebuilt.iter().any(|part| SURFACE_PARTS.contains(part));
        let gbuffer = !repainted && seen == Some((view, state.placed.version()));
        let valid = Valid { gbuffer, volume: nested::are_kept(&state.volumes, settings, &view) };
        let plan = plan(SceneFacts::of(snapshot), settings, valid);
        let (kept, work) = state.passes(&mut recorder, &plan, &prepared, settings, view)?;
        let asked = work.evaluations.asked();
        let counts: Vec<&Buffer<u32>> = work.active.iter().chain(asked).chain(state.tracer.counter()).collect();
        let (times, counted) = recorder.finish_and_fetch(&counts)?;
        state.seen = Some((view, state.placed.version()));
        let active = if work.active.is_some() { u64::from(counted[0][0]) } else { 0 };
        let device_rays = state.tracer.counted(&self.gpu, counted.last().map_or(&[], Vec::as_slice))?;
        let mut stats = statistics(&plan, times, started);
        stats.levels.iter_mut().for_each(|(level, nodes, _)| *nodes = kept.nodes(*level));
        stats.extra_samples = kept.extra_samples(&self.gpu)?;
        let specular_fragments = kept.specular_levels.is_some();
        state.kept = Some(kept);
        stats.rays = work.rays + device_rays;
        let evaluated = asked.and_then(|_| counted.get(usize::from(work.active.is_some()))).map(Vec::as_slice);
        stats.light_evaluations = (active + stats.extra_samples) * work.samples + work.evaluations.total(evaluated);
        stats.rebuilt = rebuilt.into_iter().map(str::to_owned).collect();
        stats.device_bytes = self.gpu.allocated_bytes();
        if plan.runs(DIRECT[1]) && active == 0 {
            stats.empty.push((DIRECT[1].to_owned(), "no pixel sees a surface".to_owned()));
        }
        stats.empty.extend(work.empty.iter().map(|(pass, reason)| ((*pass).to_owned(), (*reason).to_owned())));
        Ok(FrameInfo {
            generation: state.generation,
            width: camera.width,
            height: camera.height,
            supersample,
            stats,
            settings: settings.clone(),
            keep: keep.to_vec(),
            lobes: specular_fragments,
            indirect: plan.runs_indirect(),
        })
    }
}

fn statistics(plan: &Plan, times: Times, started: Instant) -> Stats {
    let total_ms = started.elapsed().as_secs_f64() * 1e3;
    let (mut stages, levels) = by_level(times.stages);
    // Work before the recording began (checks, rebasing) is the host's as well.
    if let Some((_, host)) = stages.iter_mut().find(|(name, _)| name == "host") {
        *host += total_ms - times.total_ms;
    }
    Stats {
        total_ms,
        stages,
        levels,
        skipped: plan.skipped.iter().map(|(name, reason)| ((*name).to_owned(), (*reason).to_owned())).collect(),
        ..Stats::default()
    }
}

/// Milliseconds by stage, and by level with its nodes.
type ByLevel = (Vec<(String, f64)>, Vec<(u32, u64, f64)>);

/// Stages without their levels, summed, and the time of each level.
fn by_level(timed: Vec<(String, f64)>) -> ByLevel {
    let (mut stages, mut levels) = ByLevel::default();
    for (name, ms) in timed {
        let (stage, level) = name.split_once('@').map_or((name.as_str(), None), |(s, l)| (s, l.parse().ok()));
        match stages.iter_mut().find(|(known, _)| known == stage) {
            Some((_, sum)) => *sum += ms,
            None => stages.push((stage.to_owned(), ms)),
        }
        if let Some(level) = level {
            match levels.iter_mut().find(|(known, ..)| *known == level) {
                Some((.., sum)) => *sum += ms,
                None => levels.push((level, 0, ms)),
            }
        }
    }
    (stages, levels)
}

/// What the passes did.
struct Work {
    rays: u64,
    active: Option<Buffer<u32>>,
    samples: u64,
    /// Virtual lights that were evaluated.
    evaluations: Evaluations,
    /// Passes that had nothing to do, and why.
    empty: Vec<(&'static str, &'static str)>,
}

impl State {
    fn sync(&mut self, gpu: &Gpu, prepared: &Prepared) -> Result<Vec<&'static str>> {
        let mut rebuilt = self.placed.sync(&mut self.tracer, gpu, prepared)?;
        rebuilt.extend(self.scene.sync(gpu, prepared)?);
        self.volumes.follow(self.placed.version());
        Ok(rebuilt)
    }

    /// The frame, pass by pass.
    fn passes(
        &mut self,
        recorder: &mut Recorder<'_>,
        plan: &Plan,
        prepared: &Prepared,
        settings: &Settings,
        view: View,
    ) -> Result<(Kept, Work)> {
        let Self { resources, scene, tracer, volumes, .. } = self;
        let mut context = Context { recorder, resources, scene, tracer, prepared, settings, view, volumes, rays: 0 };
        let gbuffer = gbuffer::buffers(&mut context)?;
        context.scoped("geometry", |context| geometry(context, plan, &gbuffer))?;
        let direct = match [DIRECT[1], FRAGMENTS[1], IRRADIANCE].iter().any(|pass| plan.runs(pass)) {
            true => Some(context.scoped("direct", |context| gather::record(context, &gbuffer, plan.runs_specular()))?),
            false => None,
        };
        let indirect = match plan.runs_indirect() {
            true => Some(context.scoped("indirect", |context| indirect::record(context, &gbuffer, plan.glossy))?),
            false => None,
        };
        let images = context.scoped("composite", |context| {
            let of_direct = direct.as_ref().and_then(|d| d.specular.as_ref());
            let specular = [of_direct, indirect.as_ref().and_then(|i| i.specular.as_ref())];
            let direct = direct.as_ref().map(|d| &d.irradiance);
            let indirect = indirect.as_ref().map(|i| &i.irradiance);
            let images = composite::record(context, &gbuffer, direct, indirect, specular)?;
            let factor = settings.int("supersample");
            if plan.runs(DOWNSAMPLE) { downsample::record(context, images, factor) } else { Ok(images) }
        })?;
        debug_assert!(plan.runs(COMPOSITE), "every frame is composed");
        let work = Work {
            rays: context.rays,
            samples: direct.as_ref().map_or(0, |d| d.samples),
            empty: direct.as_ref().map_or_else(Vec::new, |d| d.empty.clone()),
            active: direct.as_ref().map(|d| d.active.clone()),
            evaluations: indirect.as_ref().map_or_else(Evaluations::default, |i| i.evaluations.clone()),
        };
        Ok((Kept::of(&context, gbuffer, images, direct, indirect), work))
    }
}

fn geometry(context: &mut Context<'_, '_>, plan: &Plan, gbuffer: &GBuffer) -> Result<()> {
    if !plan.runs(GEOMETRY[2]) {
        return Ok(());
    }
    let tiled = context.view.tiled as usize;
    let most = if context.tracer.native() { PRIMARY_RAYS_NATIVE } else { PRIMARY_RAYS_GPU };
    let len = most.min(tiled);
    let hits = context.resources.buffer("primary_hits", len)?;
    let rays = context.resources.buffer("primary_rays", if plan.runs(GEOMETRY[0]) { len } else { 1 })?;
    for first in (0..tiled).step_by(len) {
        let count = len.min(tiled - first);
        if plan.runs(GEOMETRY[0]) {
            primary_rays::record(context, &rays, first, count)?;
            context.rays += context.tracer.closest(context.recorder, "trace", &rays, &hits, 0..count)?;
        } else {
            hits.write(context.recorder.gpu(), 0, &vec![Hit::MISS; len])?;
        }
        gbuffer::record(context, &hits, gbuffer, first, count)?;
    }
    Ok(())
}
