//! Who follows the work, and may stop it.
//!
//! Every loop that may take longer than a few hundredths of a second asks [`Observer::stopped`]; the work then ends with
//! [`Error::Stopped`].

use rayon::prelude::*;

use crate::{error::Error, result::Warning};

/// A step of the work, for progress displays.
///
/// # Examples
/// ```
/// use std::sync::Mutex;
/// use groundcal::{Observer, Stage};
/// struct Log(Mutex<Vec<Stage>>);
/// impl Observer for Log {
///     fn begin(&self, stage: Stage, _total: usize) {
///         self.0.lock().expect("no panic").push(stage);
///     }
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Features of each image.
    Features,
    /// Which pairs of many images look alike.
    Candidates,
    /// Matches of each pair.
    Matching,
    /// Homography of each pair.
    Homographies,
    /// Least squares matching of the floor of each motion.
    Patches,
    /// The pairs that one camera explains as motions.
    Selection,
    /// The camera.
    Camera,
}

/// Hears of the progress and may stop the work; all calls may come from any thread.
///
/// # Examples
/// ```
/// use std::sync::atomic::{AtomicBool, Ordering};
/// use groundcal::{Error, ImageSize, GrayImage, Observer, Options, calibrate_images};
/// struct Interrupt(AtomicBool);
/// impl Observer for Interrupt {
///     fn stopped(&self) -> bool {
///         self.0.load(Ordering::Relaxed)
///     }
/// }
/// let images = vec![GrayImage::filled(ImageSize::new(320, 240), 0.5); 3];
/// let names: Vec<String> = ["a", "b", "c"].map(String::from).to_vec();
/// let stopped = calibrate_images(&names, &images, &Options::default(), &Interrupt(AtomicBool::new(true)));
/// assert_eq!(stopped.err(), Some(Error::Stopped));
/// ```
pub trait Observer: Sync {
    /// A stage of `total` items begins.
    fn begin(&self, stage: Stage, total: usize) {
        let _ = (stage, total);
    }
    /// One item of the stage is done.
    fn advance(&self, stage: Stage) {
        let _ = stage;
    }
    /// Something was found out that holds whatever becomes of the work: a calibration has it among its warnings, who is refused one hears
    /// of it here alone.
    fn notice(&self, warning: &Warning) {
        let _ = warning;
    }
    /// Why a pair of images, by their names, is no motion. Called where no calibration comes of it, which has the same of every pair.
    fn pair_left_out(&self, images: [&str; 2], reason: &str) {
        let _ = (images, reason);
    }
    /// Whether the work is to stop. Asked often: an answer should take no longer than reading a flag.
    fn stopped(&self) -> bool {
        false
    }
}

/// An observer that does not listen.
///
/// # Examples
/// ```
/// use groundcal::{Observer, Silent};
/// assert!(!Silent.stopped());
/// ```
pub struct Silent;
impl Observer for Silent {}

impl dyn Observer + '_ {
    /// An error when the work is to stop.
    pub(crate) fn go_on(&self) -> Result<(), Error> {
        if self.stopped() { Err(Error::Stopped) } else { Ok(()) }
    }

    /// The outputs of a stage for its items, in their order, made in parallel.
    pub(crate) fn map<I: Sync, O: Send>(
        &self,
        stage: Stage,
        items: &[I],
        work: impl Fn(&I) -> Result<O, Error> + Sync,
    ) -> Result<Vec<O>, Error> {
        self.begin(stage, items.len());
        items
            .par_iter()
            .map(|item| {
                self.go_on()?;
                let output = work(item)?;
                self.advance(stage);
                Ok(output)
            })
            .collect()
    }
}
