//! Area lights and spot lights, as the core sees them.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::material::Texture;
use crate::error::{Error, Result};

/// What an area light emits.
#[derive(Debug, Clone)]
pub enum Radiance {
    /// The same everywhere, W·sr⁻¹·m⁻².
    Constant(Vec3),
    /// A picture: upright when seen from the lit side with `edge_u` to the right and `edge_v` up.
    Textured(Arc<Texture>),
}

/// The parallelogram corner + a·edge_u + b·edge_v, lit on the side of cross(edge_u, edge_v).
#[derive(Debug, Clone)]
pub struct AreaLight {
    /// The user's name for it.
    pub name: String,
    /// World position of a = b = 0.
    pub corner: DVec3,
    /// From a = 0 to a = 1.
    pub edge_u: DVec3,
    /// From b = 0 to b = 1.
    pub edge_v: DVec3,
    /// What it emits.
    pub radiance: Radiance,
    /// Emits alike on both sides.
    pub two_sided: bool,
    /// An opaque black surface that shows its radiance; otherwise it only lights.
    pub visible: bool,
    /// Texels are interpolated instead of constant patches.
    pub linear_filter: bool,
}

impl AreaLight {
    /// # Errors
    /// `Scene` when a number is not finite, the area is zero or the radiance is negative.
    pub fn check(&self) -> Result<()> {
        let finite = self.corner.is_finite() && self.edge_u.is_finite() && self.edge_v.is_finite();
        let cross = self.edge_u.cross(self.edge_v).length();
        let flat = cross <= 1e-12 * self.edge_u.length() * self.edge_v.length();
        if !finite || flat || cross == 0.0 {
            return Err(Error::Scene(format!(
                "area light {:?}: corner {}, edge_u {}, edge_v {}; they must be finite, and the edges neither zero nor \
                 parallel",
                self.name, self.corner, self.edge_u, self.edge_v
            )));
        }
        if let Radiance::Constant(radiance) = self.radiance {
            check_color(&format!("radiance of area light {:?}", self.name), radiance)?;
        }
        Ok(())
    }

    /// Unit normal of the lit side.
    pub fn normal(&self) -> DVec3 {
        self.edge_u.cross(self.edge_v).normalize()
    }

    /// In scene units squared.
    pub fn area(&self) -> f64 {
        self.edge_u.cross(self.edge_v).length()
    }

    /// Whether any light leaves it.
    pub fn emits(&self) -> bool {
        self.mean_radiance().max_element() > 0.0
    }

    /// Mean radiance over the light.
    pub fn mean_radiance(&self) -> Vec3 {
        match &self.radiance {
            Radiance::Constant(radiance) => *radiance,
            Radiance::Textured(texture) => texture.mean(),
        }
    }
}

/// A point light that shines into a hard-edged cone.
#[derive(Debug, Clone)]
pub struct SpotLight {
    /// The user's name for it.
    pub name: String,
    /// World position.
    pub position: DVec3,
    /// A world position on the cone's axis.
    pub target: DVec3,
    /// Radiant intensity, W·sr⁻¹.
    pub intensity: Vec3,
    /// Half-angle of the cone, degrees.
    pub cutoff_degrees: f64,
}

impl SpotLight {
    /// # Errors
    /// `Scene` when a number is not finite, the axis has no length, the cutoff is outside (0, 80] or
    /// the intensity is negative.
    pub fn check(&self) -> Result<()> {
        let axis = self.target - self.position;
        if !self.position.is_finite() || !axis.is_finite() || axis.length_squared() == 0.0 {
            return Err(Error::Scene(format!(
                "spot light {:?}: position {}, target {}; they must be finite and differ",
                self.name, self.position, self.target
            )));
        }
        if !(self.cutoff_degrees > 0.0 && self.cutoff_degrees <= 80.0) {
            return Err(Error::Scene(format!(
                "cutoff of spot light {:?} is {}; allowed are angles in (0, 80] degrees",
                self.name, self.cutoff_degrees
            )));
        }
        check_color(&format!("intensity of spot light {:?}", self.name), self.intensity)
    }

    /// Whether any light leaves it.
    pub fn emits(&self) -> bool {
        self.intensity.max_element() > 0.0
    }

    /// Unit axis of the cone.
    pub fn axis(&self) -> DVec3 {
        (self.target - self.position).normalize()
    }
}

fn check_color(what: &str, color: Vec3) -> Result<()> {
    if color.is_finite() && color.min_element() >= 0.0 {
        return Ok(());
    }
    Err(Error::Scene(format!("{what} is {color}; it must be finite and 0 or more")))
}
