//! The options of every stage, made once from those of the calibration.

use crate::{
    calibrate::options::{MotionModel, Options},
    geometry::{frame::Frame, size::ImageSize},
    pairs::{
        known_lens::LensOptions,
        observe::{MAX_NOISE_PX, ObserveOptions},
        patch::PatchStageOptions,
    },
    select::{general::GeneralOptions, plane_normal::PlaneNormalOptions, rotations::RotationOptions},
    start::{
        absolute_conic::Constraint,
        linear_camera::CameraOptions,
        rotating_camera::{RotatingOptions, Weighting},
    },
    vision::patches::PatchOptions,
};

/// What each stage is told.
pub(super) struct StageOptions<'a> {
    /// What the user said.
    pub(super) options: &'a Options,
    /// Size of the images.
    pub(super) size: ImageSize,
    /// Frame of the estimation.
    pub(super) frame: Frame,
    /// Something stood still in all images and is not used.
    pub(super) background_set_aside: bool,
    /// Homographies of pairs.
    pub(super) observe: ObserveOptions,
    /// Finding the lens; `None`: it is given, taken to be none, or there are no matches to find it from.
    pub(super) lens: Option<LensOptions>,
    /// Which pairs are plane-normal motions.
    pub(super) plane_normal: PlaneNormalOptions,
    /// Which pairs are rotations on the spot.
    pub(super) rotations: RotationOptions,
    /// Which pairs are views of one plane.
    pub(super) general: GeneralOptions,
    /// Matching the floor of the motions again; `None`: as it is.
    pub(super) patches: Option<PatchStageOptions>,
    /// The closed-form camera of plane-normal motions.
    pub(super) camera: CameraOptions,
    /// The closed-form camera of rotations.
    pub(super) rotating: RotatingOptions,
}

/// What a source of a calibration decides of the options.
#[derive(Debug, Clone, Copy)]
pub(super) struct SourceTraits {
    /// Size of the images.
    pub(super) size: ImageSize,
    /// How many pairs, the first, are named as the motions; `None`: nobody said which they are.
    pub(super) named: Option<usize>,
    /// Fewest matches on a plane where the options do not say.
    pub(super) min_plane_matches: usize,
    /// Matches are features of images, which are there to be matched again.
    pub(super) has_images: bool,
    /// There are matches, not homographies alone.
    pub(super) has_matches: bool,
    /// The images are in the order in which they were taken.
    pub(super) sequence: bool,
    /// Something stood still in all images and is not used.
    pub(super) background_set_aside: bool,
}

impl<'a> StageOptions<'a> {
    /// The constraint in force where there are no priors: `auto` stands for zero skew.
    pub(super) fn constraint_without_priors(&self) -> Constraint {
        match self.options.constraint {
            Constraint::Auto => Constraint::ZeroSkew,
            other => other,
        }
    }

    pub(super) fn new(options: &'a Options, source: &SourceTraits) -> Self {
        let size = source.size;
        let frame = options.frame(size);
        let min_matches =
            if source.has_matches { options.min_plane_matches.unwrap_or(source.min_plane_matches) } else { 0 };
        let aspect = options.aspect.unwrap_or(1.0);
        let nominal_camera = options.nominal_camera(size);
        let observe = ObserveOptions {
            frame,
            nominal_camera,
            min_matches,
            from_elsewhere: !source.has_images,
            robust: options.robust,
            seed: options.seed,
        };
        let with_k2 = !options.lens.holds_k2();
        let lens = LensOptions { size, frame, nominal_camera, with_k2 };
        Self {
            options,
            size,
            frame,
            background_set_aside: source.background_set_aside,
            observe,
            lens: (source.has_matches && options.lens_is_unknown()).then_some(lens),
            plane_normal: PlaneNormalOptions {
                size,
                frame,
                aspect,
                attitude_sigma_deg: options.attitude_sigma_deg,
                named: source.named,
                vouched: options.motion == MotionModel::PlaneNormal || !source.has_matches,
                sequence: source.sequence,
                min_matches,
            },
            rotations: RotationOptions {
                size,
                principal_point_px: options.assumed_principal_point(size),
                aspect,
                trusted: options.pairs.is_some(),
                min_matches,
            },
            general: GeneralOptions {
                min_matches,
                max_sigma_px: if source.has_images { options.robust.max_sigma_px } else { MAX_NOISE_PX },
            },
            patches: (source.has_images && options.has_patches()).then(|| PatchStageOptions {
                patches: PatchOptions { max_sigma_px: options.max_patch_sigma_px, ..PatchOptions::default() },
                observe,
            }),
            camera: options.camera(size),
            rotating: RotatingOptions {
                constraint: match options.constraint {
                    Constraint::Auto => Constraint::ZeroSkew,
                    other => other,
                },
                aspect,
                weighting: Weighting::Covariance,
            },
        }
    }
}
