//! What a render leaves behind: statistics, and images that stay on the device until they are read.

use crate::settings::Settings;

/// Host copy of one resource of a frame; row 0 is the top of the image.
#[derive(Debug, Clone, PartialEq)]
pub enum Pixels {
    /// Three floats a pixel.
    Rgb(Vec<f32>),
    /// One float a pixel.
    Scalar(Vec<f32>),
    /// True or false a pixel.
    Mask(Vec<bool>),
    /// One byte a pixel.
    Bytes(Vec<u8>),
    /// One word a pixel.
    Words(Vec<u32>),
    /// So many words a pixel.
    Rows(usize, Vec<u32>),
    /// No pixels: floats of this shape.
    Numbers(Vec<usize>, Vec<f32>),
    /// No pixels: bytes of this shape.
    Cells(Vec<usize>, Vec<u8>),
    /// No pixels: places of this shape.
    Places(Vec<usize>, Vec<f64>),
}

/// An image on the host.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row.
    pub pixels: Pixels,
}

/// Where the time of a frame went, and how much was done.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stats {
    /// Wall time of the render, without reading images back.
    pub total_ms: f64,
    /// Time of each pass, in the order in which they first ran.
    pub stages: Vec<(String, f64)>,
    /// What ran level by level: level, nodes that were looked at, milliseconds (parts of `stages`).
    pub levels: Vec<(u32, u64, f64)>,
    /// Rays traced.
    pub rays: u64,
    /// Samples beyond the partition into fragments.
    pub extra_samples: u64,
    /// Light samples evaluated.
    pub light_evaluations: u64,
    /// Passes that the plan left out, with the reason.
    pub skipped: Vec<(String, String)>,
    /// Passes that ran on nothing, with the reason.
    pub empty: Vec<(String, String)>,
    /// What was rebuilt or uploaded again since the last frame.
    pub rebuilt: Vec<String>,
    /// Bytes on the device after the frame.
    pub device_bytes: u64,
}

/// A rendered frame, as data: all but the images.
#[derive(Debug, Clone)]
pub struct FrameInfo {
    /// Which render of its renderer this was.
    pub generation: u64,
    /// Columns of the image.
    pub width: u32,
    /// Rows of the image.
    pub height: u32,
    /// Internal pixels for each pixel of the image, an axis.
    pub supersample: u32,
    /// Time and counts.
    pub stats: Stats,
    /// Every setting, resolved.
    pub settings: Settings,
    /// Whether lobes had fragments of their own.
    pub lobes: bool,
    /// Whether there is indirect light.
    pub indirect: bool,
    /// Inner resources that were asked for.
    pub keep: Vec<String>,
}

/// Level of a pixel that shows a light or is provably unlit.
pub const LEVEL_CULLED: u8 = 254;
/// Level of a pixel that shows nothing.
pub const LEVEL_NOTHING: u8 = 255;

/// Why a fragment was refined or culled; twin of `miplight.Reason`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Reason {
    /// Not refined: it is as coarse as allowed.
    Coarsest = 0,
    /// A depth discontinuity.
    Depth = 1,
    /// A normal discontinuity.
    Normal = 2,
    /// A difference of illumination.
    Illumination = 3,
    /// A difference of visibility.
    Visibility = 4,
    /// The lobe needs finer sampling.
    Lobe = 5,
    /// Culled: it shows a light.
    Emitter = 6,
    /// Culled: it faces away from every light.
    FacingAway = 7,
    /// Culled: it lies behind every light.
    BehindLight = 8,
    /// Culled: no light is in its lobe.
    OutsideLobe = 9,
    /// Nothing is seen.
    Nothing = 255,
}
