//! Which passes a frame needs, and why it does without the others: a pure function, tested without a GPU.

use crate::scene::light::Radiance;
use crate::scene::snapshot::Snapshot;
use crate::settings::Settings;

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
}

impl SceneFacts {
    /// Looks at what is there; lights without radiance do not count.
    pub fn of(snapshot: &Snapshot) -> Self {
        let emits = |radiance: &Radiance| match radiance {
            Radiance::Constant(c) => c.max_element() > 0.0,
            Radiance::Textured(texture) => texture.mean().max_element() > 0.0,
        };
        Self {
            meshes: snapshot.instances.len(),
            visible_lights: snapshot.area_lights.iter().filter(|l| l.visible).count(),
            area_lights: snapshot.area_lights.iter().filter(|l| emits(&l.radiance)).count(),
            spot_lights: snapshot.spot_lights.iter().filter(|l| l.intensity.max_element() > 0.0).count(),
        }
    }
}

/// What the last frame left behind that still holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Valid {
    /// The G-buffer: same geometry, same camera, same size.
    pub gbuffer: bool,
}

/// The passes of a frame, in order, and the reasons for those left out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Plan {
    /// Names as in the times.
    pub passes: Vec<&'static str>,
    /// Name and reason.
    pub skipped: Vec<(&'static str, &'static str)>,
}

/// Passes that find what each pixel sees.
pub const GEOMETRY: [&str; 3] = ["geometry/primary_rays", "geometry/trace", "geometry/gbuffer"];
/// Passes of direct light.
pub const DIRECT: [&str; 5] =
    ["direct/light_samples", "direct/receivers", "direct/shadow", "direct/gather", "direct/gather_ratio"];
/// Passes of indirect light.
pub const INDIRECT: [&str; 5] =
    ["indirect/gather_rays", "indirect/trace", "indirect/gather_hits", "indirect/shadow", "indirect/gather_sum"];
/// From irradiance to radiance.
pub const COMPOSITE: &str = "composite/composite";
/// From internal pixels to the image's.
pub const DOWNSAMPLE: &str = "composite/downsample";

impl Plan {
    fn add(&mut self, passes: &[&'static str], skip: Option<&'static str>) {
        match skip {
            None => self.passes.extend(passes),
            Some(reason) => self.skipped.extend(passes.iter().map(|p| (*p, reason))),
        }
    }

    /// Whether a pass runs.
    pub fn runs(&self, pass: &str) -> bool {
        self.passes.contains(&pass)
    }
}

/// Plans a frame.
pub fn plan(facts: SceneFacts, settings: &Settings, valid: Valid) -> Plan {
    let mut plan = Plan::default();
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
    let no_area = (facts.area_lights == 0).then_some("no area light emits anything");
    plan.add(&DIRECT[..1], direct.or(no_area));
    plan.add(&DIRECT[1..2], direct);
    plan.add(&DIRECT[2..3], direct.or(settings.is("visibility", "none").then_some("visibility is none")));
    let ratio = settings.is("direct_estimator", "ratio");
    let no_sum = (ratio && facts.spot_lights == 0).then_some("direct_estimator is ratio, and there is no spot light");
    plan.add(&DIRECT[3..4], direct.or(no_sum));
    plan.add(&DIRECT[4..], direct.or(no_area).or((!ratio).then_some("direct_estimator is samples")));

    let indirect = settings.is("indirect", "off").then_some("indirect is off").or(no_surface).or(no_light);
    plan.add(&INDIRECT, indirect);
    plan.add(&[COMPOSITE], None);
    plan.add(&[DOWNSAMPLE], (settings.int("supersample") == 1).then_some("supersample is 1"));
    plan
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Value;

    const ROOM: SceneFacts = SceneFacts { meshes: 2, visible_lights: 1, area_lights: 1, spot_lights: 0 };

    fn settings(changes: &[(&'static str, &str)]) -> Settings {
        Settings::new(changes.iter().map(|(n, v)| (*n, Value::Text((*v).to_owned())))).unwrap()
    }

    fn reason(plan: &Plan, pass: &str) -> &'static str {
        plan.skipped.iter().find(|(p, _)| *p == pass).map_or("", |(_, r)| r)
    }

    #[test]
    fn every_pass_is_either_run_or_skipped_with_a_reason_and_never_both() {
        let all = [&GEOMETRY[..], &DIRECT, &INDIRECT, &[COMPOSITE, DOWNSAMPLE]].concat();
        for facts in [ROOM, SceneFacts::default(), SceneFacts { spot_lights: 1, area_lights: 0, ..ROOM }] {
            for gbuffer in [false, true] {
                for change in [
                    ("indirect", "off"),
                    ("indirect", "final-gather"),
                    ("direct", "off"),
                    ("visibility", "none"),
                    ("direct_estimator", "ratio"),
                ] {
                    let plan = plan(facts, &settings(&[change]), Valid { gbuffer });
                    for pass in &all {
                        assert_ne!(plan.runs(pass), !reason(&plan, pass).is_empty(), "{pass} {facts:?} {change:?}");
                    }
                }
            }
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
        assert!(!plan(ROOM, &off, Valid { gbuffer: true }).runs(GEOMETRY[1]));
        assert!(plan(ROOM, &settings(&[("indirect", "final-gather")]), Valid::default()).runs(INDIRECT[4]));
    }
}
