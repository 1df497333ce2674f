//! Which passes a frame needs, and why it does without the others: a pure function, tested without a GPU.

mod asks;
mod names;
mod virtual_lights;

use crate::scene::light::Radiance;
use crate::scene::snapshot::Snapshot;
use crate::settings::Settings;
pub use asks::*;
pub use names::*;

/// What the plan needs to know of a scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SceneFacts {
    /// Meshes placed in the scene.
    pub meshes: usize,
    /// Lights that the camera could see.
    pub visible_lights: usize,
    /// Area lights that emit something.
    pub area_lights: usize,
    /// Spot lights that emit something.
    pub spot_lights: usize,
    /// Area lights that emit a picture.
    pub pictures: usize,
    /// Meshes with a specular part.
    pub specular: usize,
}

impl SceneFacts {
    /// Looks at what is there; lights without radiance do not count.
    pub fn of(snapshot: &Snapshot) -> Self {
        Self {
            meshes: snapshot.instances.len(),
            visible_lights: snapshot.area_lights.iter().filter(|l| l.visible).count(),
            area_lights: snapshot.area_lights.iter().filter(|l| l.emits()).count(),
            spot_lights: snapshot.spot_lights.iter().filter(|l| l.emits()).count(),
            pictures: snapshot
                .area_lights
                .iter()
                .filter(|l| l.emits() && matches!(l.radiance, Radiance::Textured(_)))
                .count(),
            specular: snapshot.instances.iter().filter(|i| i.is_specular()).count(),
        }
    }
}

/// What the last frame left behind that still holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Valid {
    /// The G-buffer: same geometry, same camera, same size.
    pub gbuffer: bool,
    /// Samples of surfaces and blocked faces: same geometry, same settings of the volume.
    pub volume: bool,
}

/// The passes of a frame, in order, and the reasons for those left out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Plan {
    /// Names as in the times.
    pub passes: Vec<&'static str>,
    /// Name and reason.
    pub skipped: Vec<(&'static str, &'static str)>,
    /// Whether lobes count.
    pub glossy: bool,
}

impl Plan {
    fn add(&mut self, passes: &[&'static str], skip: Option<&'static str>) {
        match skip {
            None => self.passes.extend(passes),
            Some(reason) => self.skipped.extend(passes.iter().map(|p| (*p, reason))),
        }
    }

    /// Whether anything of lobes runs.
    pub fn runs_specular(&self) -> bool {
        [SPECULAR, LOBE_INTEGRAL[0], LOBES[0]].iter().any(|pass| self.runs(pass))
    }

    /// Whether there is indirect light.
    pub fn runs_indirect(&self) -> bool {
        [INDIRECT[1], RSM[0], LPV[2]].iter().any(|pass| self.runs(pass))
    }

    /// Whether a pass runs.
    pub fn runs(&self, pass: &str) -> bool {
        self.passes.contains(&pass)
    }
}

/// Plans a frame.
pub fn plan(facts: SceneFacts, settings: &Settings, valid: Valid) -> Plan {
    let glossy = facts.specular > 0 && settings.is("specular", "on");
    let mut plan = Plan { glossy, ..Plan::default() };
    let nothing_to_see = facts.meshes + facts.visible_lights == 0;
    let no_surface = (facts.meshes == 0).then_some("the scene has no mesh");
    let no_light = (facts.area_lights + facts.spot_lights == 0).then_some("no light emits anything");

    let geometry = match (nothing_to_see, valid.gbuffer) {
        (true, _) => Some("the scene has neither a mesh nor a visible light"),
        (_, true) => Some("neither geometry nor camera changed since the last frame"),
        _ => None,
    };
    plan.add(&GEOMETRY[..2], geometry);
    // Without anything to see the G-buffer is still written: every pixel says so.
    plan.add(&GEOMETRY[2..], valid.gbuffer.then_some("neither geometry nor camera changed since the last frame"));

    let direct = settings.is("direct", "off").then_some("direct is off").or(no_surface).or(no_light);
    plan.add_direct(facts, settings, direct);
    plan.add_adaptive(facts, settings, direct);
    let matt = (facts.specular == 0).then_some("no material has a specular part");
    let matt = direct.or(settings.is("specular", "off").then_some("specular is off")).or(matt);
    plan.add_specular(facts, settings, matt);

    let indirect = settings.is("indirect", "off").then_some("indirect is off").or(no_surface).or(no_light);
    plan.add_indirect(settings, valid, indirect);
    plan.add(&[COMPOSITE], None);
    plan.add(&[DOWNSAMPLE], (settings.int("supersample") == 1).then_some("supersample is 1"));
    plan
}

/// Why occlusion is not found by `kind`.
fn other_visibility(settings: &Settings, kind: &str) -> Option<&'static str> {
    let reasons = [
        ("none", "visibility is none"),
        ("ray", "visibility is ray"),
        ("voxel", "visibility is voxel"),
        ("shadow-map", "visibility is shadow-map"),
    ];
    reasons.into_iter().find(|(name, _)| *name != kind && settings.is("visibility", name)).map(|(_, reason)| reason)
}

impl Plan {
    /// What is made once for all that ask whether they see a light sample.
    pub fn add_prepared_occlusion(&mut self, settings: &Settings, skip: Option<&'static str>) {
        self.add(&VOXELS[..2], skip.or(other_visibility(settings, "voxel")));
        self.add(&MAPS[..2], skip.or(other_visibility(settings, "shadow-map")));
    }

    /// Those who ask it.
    pub fn add_occlusion(&mut self, settings: &Settings, skip: Option<&'static str>) {
        self.add(&DIRECT[2..3], skip.or(other_visibility(settings, "ray")));
        self.add(&VOXELS[2..], skip.or(other_visibility(settings, "voxel")));
        self.add(&MAPS[2..], skip.or(other_visibility(settings, "shadow-map")));
    }

    /// Every pixel for itself, or every fragment.
    fn add_direct(&mut self, facts: SceneFacts, settings: &Settings, direct: Option<&'static str>) {
        let no_area = (facts.area_lights == 0).then_some("no area light emits anything");
        self.add(&DIRECT[..1], direct.or(no_area));
        let adaptive = is_adaptive(settings).then_some("shadows decide what is worth a ray: refine is not none");
        self.add_prepared_occlusion(settings, direct.or(adaptive));
        let fragments = has_fragments(settings).then_some("fragments are shaded: refine is not none");
        let pixels = (!has_fragments(settings)).then_some("every pixel is shaded, or shadows decide what is");
        self.add(&DIRECT[1..2], direct.or(adaptive).or(fragments));
        let flat = (settings.int("coarsest_level") == 0).then_some("coarsest_level is 0");
        let chosen = if is_adaptive(settings) && splits_by_geometry(settings) { None } else { pixels };
        self.add(&FRAGMENTS[..1], direct.or(chosen).or(flat));
        self.add(&FRAGMENTS[1..3], direct.or(chosen));
        let by_level = is_by_level(settings).then_some("fragments are looked at level by level");
        self.add(&FRAGMENTS[3..], direct.or(pixels).or(by_level));
        let at_once = (!is_by_level(settings)).then_some("fragments are not looked at level by level");
        let around = (!is_incremental(settings)).then_some("refine is not incremental");
        let inside = (!is_sub_fragment(settings)).then_some("refine is not sub-fragment");
        let unshadowed = settings.is("visibility", "none").then_some("visibility is none");
        self.add(&LEVELS[..1], direct.or(at_once));
        self.add(&INCREMENTAL[..1], direct.or(around).or(unshadowed));
        // Sub-fragments find the edge of a spot's cone, too.
        let untested = if facts.spot_lights > 0 { None } else { unshadowed };
        self.add(&SUB_FRAGMENTS[..1], direct.or(inside).or(untested));
        self.add_occlusion(settings, direct.or(adaptive));
        self.add(&INCREMENTAL[1..], direct.or(around));
        self.add(&SUB_FRAGMENTS[1..2], direct.or(inside));
        self.add(&SUB_FRAGMENTS[2..3], direct.or(inside).or(untested));
        let unguarded = (!guards_stops(settings)).then_some("stop_guard is off, or visibility is voxel or shadow-map");
        self.add(&SUB_FRAGMENTS[3..4], direct.or(inside).or(unguarded).or(untested));
        let alone = (!adds_extra_samples(settings)).then_some("extra_samples is off, or upsample is not rbf");
        self.add(&SUB_FRAGMENTS[4..], direct.or(inside).or(alone));
        self.add(&LEVELS[1..], direct.or(at_once));
        let ratio = settings.is("direct_estimator", "ratio");
        let no_sum =
            (ratio && facts.spot_lights == 0).then_some("direct_estimator is ratio, and there is no spot light");
        self.add(&DIRECT[3..4], direct.or(adaptive).or(by_level).or(no_sum));
        let no_ratio = (!ratio).then_some("direct_estimator is samples");
        self.add(&DIRECT[4..], direct.or(adaptive).or(no_area).or(no_ratio));
        let other = (!settings.is("upsample", "rbf")).then_some("upsample is another");
        let small = (settings.int("coarsest_level") < 3).then_some("coarsest_level is below 3");
        self.add(&RBF[..1], direct.or(pixels).or(other).or(small));
        let paper = settings.is("rbf_form", "paper");
        for (pass, upsample) in UPSAMPLE.into_iter().zip(["nearest", "bilinear", "edge-aware", "rbf"]) {
            let other = (!settings.is("upsample", upsample)).then_some("upsample is another");
            let form = (upsample == "rbf" && paper).then_some("rbf_form is paper");
            self.add(&[pass], direct.or(pixels).or(other).or(form));
        }
        let form = (!paper).then_some("rbf_form is interpolating");
        self.add(&RBF[1..], direct.or(pixels).or(other).or(form));
        let to_the_pixels = (settings.int("finest_level") == 0).then_some("finest_level is 0");
        self.add(&[BILATERAL], direct.or(at_once).or(to_the_pixels));
    }

    /// What lobes reflect; `matt`: why nothing.
    fn add_specular(&mut self, facts: SceneFacts, settings: &Settings, matt: Option<&'static str>) {
        let no_area = (facts.area_lights == 0).then_some("no area light emits anything");
        let no_spot = (facts.spot_lights == 0).then_some("there is no spot light, and area lights have a better way");
        let ratio = settings.is("direct_estimator", "ratio");
        let summed = !ratio && !has_fragments(settings);
        let unshadowed = settings.is("visibility", "none").then_some("visibility is none");
        self.add(&[SPECULAR], matt.or(if summed { None } else { no_spot }));
        let samples = (!ratio).then_some("direct_estimator is samples");
        self.add(&LOBE_INTEGRAL[..1], matt.or(samples).or(no_area));
        self.add(&LOBE_INTEGRAL[1..2], matt.or(samples).or(no_area).or(unshadowed));
        self.add(&LOBE_INTEGRAL[2..], matt.or(samples).or(no_area));
        let pixels =
            (ratio || summed).then_some("lobes have no fragments: refine is none or direct_estimator is ratio");
        self.add(&LOBES, matt.or(pixels).or(no_area));
    }

    /// Tiles, cells, penumbrae.
    fn add_adaptive(&mut self, facts: SceneFacts, settings: &Settings, direct: Option<&'static str>) {
        let other = (!is_adaptive(settings))
            .then_some("every pixel asks for itself: refine is none or direct_estimator is samples");
        let (all, direct) = (direct, direct.or(other));
        let unshadowed = settings.is("visibility", "none").then_some("visibility is none");
        let no_area = (facts.area_lights == 0).then_some("no area light emits anything, and spots have no penumbra");
        let unproven = settings.is("shadow_proofs", "off").then_some("shadow_proofs is off");
        let unfiltered = settings.is("penumbra_filter", "off").then_some("penumbra_filter is off");
        let guards = guards_stops(settings);
        let unguarded = if facts.spot_lights > 0 { None } else { unshadowed };
        self.add(&ADAPTIVE[..1], if guards { all.or(unguarded) } else { direct });
        self.add(&ADAPTIVE[1..2], if guards { all.or(unshadowed) } else { direct.or(unshadowed).or(unproven) });
        self.add(&ADAPTIVE[2..6], direct.or(unshadowed));
        self.add(&ADAPTIVE[6..7], direct);
        let sharp = direct.or(unshadowed).or(no_area);
        self.add(&ADAPTIVE[7..13], sharp);
        self.add(&ADAPTIVE[13..14], sharp.or(unfiltered));
        self.add(&ADAPTIVE[14..], direct);
        let plain = (facts.pictures == 0).then_some("no light emits a picture");
        self.add(&[TEXTURED_SHARE], direct.or(plain));
        self.add(&[IRRADIANCE], direct);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Value;

    const ROOM: SceneFacts =
        SceneFacts { meshes: 2, visible_lights: 1, area_lights: 1, spot_lights: 0, pictures: 0, specular: 0 };

    fn settings(changes: &[(&'static str, &str)]) -> Settings {
        Settings::new(changes.iter().map(|(n, v)| (*n, Value::Text((*v).to_owned())))).unwrap()
    }

    fn reason(plan: &Plan, pass: &str) -> &'static str {
        plan.skipped.iter().find(|(p, _)| *p == pass).map_or("", |(_, r)| r)
    }

    #[test]
    fn every_pass_is_either_run_or_skipped_with_a_reason_and_never_both() {
        let all = [
            &GEOMETRY[..],
            &DIRECT,
            &ADAPTIVE,
            &FRAGMENTS,
            &LEVELS,
            &INCREMENTAL,
            &SUB_FRAGMENTS,
            &UPSAMPLE,
            &VOXELS,
            &MAPS,
            &[TEXTURED_SHARE, IRRADIANCE, BILATERAL, SPECULAR],
            &RBF,
            &LOBE_INTEGRAL,
            &LOBES,
            &INDIRECT,
            &POINTS,
            &LPV,
            &RSM,
            &[RSM_TREE],
            &VPLS,
            &VPL_FRAGMENTS,
            &TRANSPORT,
            &VPL_LISTS,
            &VPL_VISIBLE,
            &VPL_UPSAMPLE,
            &[COMPOSITE, DOWNSAMPLE],
        ]
        .concat();
        for facts in [ROOM, SceneFacts::default(), SceneFacts { spot_lights: 1, area_lights: 0, ..ROOM }] {
            for gbuffer in [false, true] {
                for change in [
                    ("indirect", "off"),
                    ("indirect", "final-gather"),
                    ("indirect", "clustered"),
                    ("indirect", "lpv"),
                    ("refine_lists", "per-light"),
                    ("direct_refine", "none"),
                    ("direct", "off"),
                    ("visibility", "none"),
                    ("visibility", "voxel"),
                    ("visibility", "shadow-map"),
                    ("direct_estimator", "ratio"),
                ] {
                    for refine in ["none", "one-pass", "incremental", "sub-fragment"] {
                        let plan =
                            plan(facts, &settings(&[change, ("refine", refine)]), Valid { gbuffer, volume: gbuffer });
                        for pass in &all {
                            let why = reason(&plan, pass);
                            assert_ne!(plan.runs(pass), !why.is_empty(), "{pass} {facts:?} {change:?} {refine}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_adaptive_chain_takes_the_place_of_pixels_for_themselves() {
        let adaptive = settings(&[("refine", "one-pass"), ("direct_estimator", "ratio")]);
        let chain = plan(ROOM, &adaptive, Valid::default());
        assert!(ADAPTIVE.iter().all(|pass| chain.runs(pass)) && chain.runs(IRRADIANCE) && chain.runs(DIRECT[0]));
        assert!(DIRECT[1..].iter().all(|pass| !chain.runs(pass)));
        let spots = SceneFacts { area_lights: 0, spot_lights: 1, ..ROOM };
        let chain = plan(spots, &adaptive, Valid::default());
        assert!(chain.runs("direct/cell_shadow") && !chain.runs("direct/zone_shadow") && chain.runs(IRRADIANCE));
    }

    #[test]
    fn occlusion_is_found_in_one_way() {
        for (kind, runs) in [("none", ""), ("ray", "shadow"), ("voxel", "voxel_shadow"), ("shadow-map", "map_shadow")] {
            let plan = plan(ROOM, &settings(&[("visibility", kind)]), Valid::default());
            let all = [DIRECT[2], VOXELS[0], VOXELS[2], MAPS[0], MAPS[1], MAPS[2]];
            let asked: Vec<_> = all.into_iter().filter(|pass| plan.runs(pass)).collect();
            assert!(asked.iter().all(|pass| asked.len() <= 3 && pass.starts_with("direct/")));
            assert_eq!(asked.last().map_or("", |pass| &pass[7..]), runs);
            assert_eq!(plan.runs(VOXELS[0]), kind == "voxel");
        }
    }

    #[test]
    fn leaves_out_what_the_scene_does_not_need() {
        let off = settings(&[]);
        assert_eq!(reason(&plan(ROOM, &off, Valid::default()), INDIRECT[0]), "indirect is off");
        let dark = SceneFacts { area_lights: 0, ..ROOM };
        assert_eq!(reason(&plan(dark, &off, Valid::default()), DIRECT[3]), "no light emits anything");
        let spots = SceneFacts { area_lights: 0, spot_lights: 2, ..ROOM };
        let spotted = plan(spots, &off, Valid::default());
        assert!(!spotted.runs(DIRECT[0]) && spotted.runs(DIRECT[2]));
        assert!(!plan(ROOM, &off, Valid { gbuffer: true, ..Valid::default() }).runs(GEOMETRY[1]));
        assert!(plan(ROOM, &settings(&[("indirect", "final-gather")]), Valid::default()).runs(INDIRECT[4]));
    }
}
