//! What a feature is, and how they are looked for.

/// How features are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FeatureOptions {
    /// Most features kept of an image, spread over it.
    pub max_features: usize,
    /// Least response |D| times the number of scales in an octave, for values in 0..1 (Lowe: 0.03, OpenCV: 0.04).
    pub contrast_threshold: f64,
    /// Largest ratio of principal curvatures.
    pub edge_ratio: f64,
    /// Images up to this many pixels get an upsampled first octave.
    pub upsample_below_px: usize,
    /// Larger images are halved before the first octave until they have no more pixels than this.
    pub halve_above_px: usize,
}

/// Most features of an image, and most of its pixels, where features only have to find the planes of pairs. (Of 12 sets of 6 to 25 pictures no pair that
/// 3000 features at twice the size join by 40 matches or more is lost, but one of 261 of a turntable without texture.)
const COARSE_MAX_FEATURES: usize = 1200;
const COARSE_MAX_PX: usize = 1_500_000;

impl FeatureOptions {
    /// The same of fewer features and pixels, without an upsampled octave: enough to find which pairs see one plane, and where patches are to be
    /// sought. An eighth of the work.
    pub(crate) fn coarse(&self) -> Self {
        Self {
            max_features: self.max_features.min(COARSE_MAX_FEATURES),
            upsample_below_px: 0,
            halve_above_px: self.halve_above_px.min(COARSE_MAX_PX),
            ..*self
        }
    }
}

impl Default for FeatureOptions {
    fn default() -> Self {
        Self {
            max_features: 3000,
            contrast_threshold: 0.01,
            edge_ratio: 10.0,
            upsample_below_px: 1_500_000,
            halve_above_px: 6_000_000,
        }
    }
}

/// Number of histogram cells of a descriptor.
pub(crate) const DESCRIPTOR_LENGTH: usize = 128;

/// A feature of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Feature {
    /// Column in pixels, (0, 0) the centre of the top-left pixel.
    pub x: f32,
    /// Row in pixels.
    pub y: f32,
    /// Standard deviation of the Gaussian at which it was found, in pixels.
    pub scale_px: f32,
    /// Direction of the dominant gradient, radians, from x towards y.
    pub angle_rad: f32,
    /// |D| at the extremum.
    pub response: f32,
}

/// The features of an image.
#[derive(Debug, Clone, Default)]
pub(crate) struct Features {
    /// Where they are.
    pub points: Vec<Feature>,
    /// One descriptor of `DESCRIPTOR_LENGTH` values a feature, unit length, end to end.
    pub descriptors: Vec<f32>,
}

impl Features {
    /// The first so many, which are the strongest.
    pub(crate) fn strongest(&self, most: usize) -> Self {
        let kept = most.min(self.points.len());
        Self {
            points: self.points[..kept].to_vec(),
            descriptors: self.descriptors[..kept * DESCRIPTOR_LENGTH].to_vec(),
        }
    }
}
