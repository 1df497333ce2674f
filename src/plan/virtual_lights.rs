//! The part of the plan that is indirect light.

use super::names::{
    INDIRECT, LPV, POINTS, RSM, RSM_TREE, TRANSPORT, VPL_FRAGMENTS, VPL_LISTS, VPL_UPSAMPLE, VPL_VISIBLE, VPLS,
};
use super::{Plan, Valid, gathers_at_points, has_lists_per_light, has_volume, indirect_from_virtual_lights};
use crate::settings::Settings;

impl Plan {
    /// What the settings leave of it; `skip`: why nothing.
    pub(super) fn add_indirect(&mut self, settings: &Settings, valid: Valid, skip: Option<&'static str>) {
        let gathers = settings.is("indirect", "final-gather");
        let by_rays = gathers.then_some("indirect light is gathered by rays: indirect is final-gather");
        let by_lights = indirect_from_virtual_lights(settings).then_some("indirect light comes from virtual lights");
        let by_cells = has_volume(settings).then_some("indirect light comes from a volume: indirect is lpv");
        let at_points = gathers_at_points(settings).then_some("points between the pixels gather: refine is not none");
        let other = skip.or(by_lights).or(by_cells);
        self.add(&INDIRECT[..1], other.or(at_points));
        self.add(&INDIRECT[1..2], other);
        let pixels = gathers.then_some("every pixel gathers for itself: refine is none");
        self.add(&POINTS, other.or(if gathers_at_points(settings) { None } else { pixels }));
        self.add_volume(settings, valid, skip.or(by_rays).or(by_lights));
        self.add(&INDIRECT[2..4], skip.or(by_lights));
        self.add(&INDIRECT[4..], skip.or(by_lights).or(at_points));
        self.add_virtual_lights(settings, skip.or(by_rays).or(by_cells));
        self.add_virtual_fragments(settings, skip.or(by_rays));
    }

    fn add_volume(&mut self, settings: &Settings, valid: Valid, skip: Option<&'static str>) {
        let kept = valid.volume.then_some("neither geometry nor the volume changed since the last frame");
        let unasked = settings.is("indirect_visibility", "off").then_some("indirect_visibility is off");
        self.add(&LPV[..2], skip.or(kept));
        self.add(&LPV[2..6], skip);
        self.add(&LPV[6..], skip.or(kept).or(unasked));
    }

    fn add_virtual_lights(&mut self, settings: &Settings, skip: Option<&'static str>) {
        let is = |indirect: &str| settings.is("indirect", indirect);
        let importance = settings.is("vpl_pattern", "importance");
        let flat = !is("clustered") && !is("hierarchical");
        self.add(&RSM, skip);
        let plain = (flat && !importance).then_some("virtual lights are neither clustered nor chosen by importance");
        self.add(&[RSM_TREE], skip.or(plain));
        let cut = is("hierarchical").then_some("each fragment has a cut through the tree of its own");
        let clustered = is("clustered").then_some("virtual lights are clustered");
        let other = |wanted: bool| (importance != wanted).then_some("vpl_pattern is another");
        self.add(&VPLS[..1], skip.or(cut).or(clustered).or(other(false)));
        self.add(&VPLS[1..2], skip.or(cut).or(clustered).or(other(true)));
        self.add(&VPLS[2..], skip.or((!is("clustered")).then_some("indirect is not clustered")));
    }

    fn add_virtual_fragments(&mut self, settings: &Settings, skip: Option<&'static str>) {
        let pixels = settings.is("refine", "none").then_some("every pixel is shaded: refine is none");
        let flat = (settings.int("coarsest_level") == 0).then_some("coarsest_level is 0");
        let iterative = settings.is("refine", "iterative");
        let at_once = (!iterative).then_some("refine is not iterative");
        self.add(&VPL_FRAGMENTS[..1], skip.or(pixels).or(flat));
        self.add(&VPL_FRAGMENTS[1..2], skip.or(pixels));
        let shared = (!has_lists_per_light(settings)).then_some("fragments are shared: refine_lists is shared");
        self.add(&VPL_LISTS, skip.or(pixels).or(shared));
        let own = has_lists_per_light(settings).then_some("each virtual light has fragments of its own");
        self.add(&VPL_FRAGMENTS[2..3], skip.or(pixels).or(own).or(flat).or(at_once));
        self.add(&VPL_FRAGMENTS[3..5], skip.or(pixels).or(own));
        self.add(&VPL_FRAGMENTS[5..], skip.or((!settings.is("refine", "none")).then_some("fragments are shaded")));
        let ways = [["gather", "clustered"], ["splat", "splat"], ["hierarchical", "hierarchical"]];
        for (pass, names) in TRANSPORT.into_iter().zip(ways) {
            let other = (!names.iter().any(|name| settings.is("indirect", name))).then_some("indirect is another");
            self.add(&[pass], skip.or(own).or(other));
        }
        let unasked = settings.is("indirect_visibility", "off").then_some("indirect_visibility is off");
        let inside = has_volume(settings).then_some("indirect light comes from a volume: indirect is lpv");
        self.add(&VPL_VISIBLE, skip.or(unasked).or(own).or(inside));
        for (pass, upsample) in VPL_UPSAMPLE.into_iter().zip(["nearest", "bilinear", "edge-aware", "rbf", "rbf", "rbf"])
        {
            let other = (!settings.is("upsample", upsample)).then_some("upsample is another");
            let paper = settings.is("rbf_form", "paper");
            let form = match pass {
                "indirect/rbf" => paper.then_some("rbf_form is paper"),
                "indirect/rbf_paper" => (!paper).then_some("rbf_form is interpolating"),
                "indirect/rbf_samples" => (settings.int("coarsest_level") < 3).then_some("coarsest_level is below 3"),
                _ => None,
            };
            self.add(&[pass], skip.or(pixels).or(own).or(other).or(form));
        }
    }
}
