//! What the studies have in common whatever they vary: how the attitudes of the motions differ, how many matches there are, the image.
//!
//! Two kinds of attitudes stand in each study. *Wide* ones are as one would hold a camera to calibrate it. *Narrow* ones, rolls within ten degrees of
//! level, are as a head, a robot or a car has them: horizons are nearly parallel, and of the four unknowns of zero skew fx and the aspect
//! ratio trade off. The paper's errors and the order of its methods are those of narrow attitudes and few matches.

use groundcal::geometry::ImageSize;

use crate::tables::six_digits_trimmed;

/// The image where nothing else is asked for, and the focal length over its width.
const SIZE: ImageSize = ImageSize { width: 1280, height: 960 };
pub(super) const FOCAL_OVER_WIDTH: f64 = 1000.0 / 1280.0;

/// Standard deviation of each image coordinate where nothing else is asked for, pixels.
pub(super) const NOISE_PX: f64 = 1.0;

/// How the attitudes of the motions differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Attitudes {
    /// As one would hold a camera to calibrate it: rolls of up to 45 degrees to either side.
    Wide,
    /// As on a head or a carrier: the same pitches, rolls within so many degrees of level.
    RollsWithin(f64),
}

impl Attitudes {
    /// Rolls of the narrow condition, degrees to either side.
    pub const NARROW: Attitudes = Attitudes::RollsWithin(10.0);

    /// For a narrow column.
    pub(super) fn short(self) -> String {
        match self {
            Attitudes::Wide => "wide".into(),
            Attitudes::RollsWithin(deg) => format!("<{deg}"),
        }
    }

    /// In words, for titles.
    pub fn words(self) -> String {
        match self {
            Attitudes::Wide => "wide attitudes".into(),
            Attitudes::RollsWithin(deg) => format!("rolls within {deg} degrees"),
        }
    }
}

/// What is the same for all points of a curve, whatever is varied along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// Attitudes of the motions.
    pub attitudes: Attitudes,
    /// Matches of each motion.
    pub matches: usize,
    /// The image.
    pub size: ImageSize,
}

impl Default for Setting {
    /// Wide attitudes, 200 matches a motion, 1280 x 960 pixels.
    fn default() -> Self {
        Self { attitudes: Attitudes::Wide, matches: 200, size: SIZE }
    }
}

impl Setting {
    /// Matches and attitudes in words, for titles.
    pub fn words(&self) -> String {
        format!("{} matches, {}", self.matches, self.attitudes.words())
    }

    /// Columns of tables: [`SETTING`].
    pub(super) fn record(&self) -> Vec<String> {
        let roll = match self.attitudes {
            Attitudes::Wide => String::new(),
            Attitudes::RollsWithin(deg) => six_digits_trimmed(deg),
        };
        vec![self.matches.to_string(), roll, self.size.width.to_string(), self.size.height.to_string()]
    }
}

/// Names of the columns of a setting; the roll is empty for wide attitudes.
pub(super) const SETTING: [&str; 4] = ["matches", "roll_deg", "image_width", "image_height"];

/// What a study may be asked for in place of its own settings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Asked {
    /// Matches a motion; `None`: 200, and 20.
    pub matches: Option<usize>,
    /// Rolls within so many degrees; `None`: wide attitudes, and the narrow condition.
    pub roll_deg: Option<f64>,
    /// Standard deviation of each image coordinate where it is not varied, pixels; `None`: 1.
    pub noise_px: Option<f64>,
    /// The image, seen by a camera of the same field of view; `None`: 1280 x 960.
    pub size: Option<ImageSize>,
}

impl Asked {
    /// The settings of the curves, in the order of the panels.
    pub fn settings(&self) -> Vec<Setting> {
        let size = self.size.unwrap_or(SIZE);
        let attitudes = match self.roll_deg {
            Some(deg) => vec![Attitudes::RollsWithin(deg)],
            None => vec![Attitudes::Wide, Attitudes::NARROW],
        };
        let matches = self.matches.map_or(vec![200, 20], |matches| vec![matches]);
        let with = |attitudes: Attitudes| matches.iter().map(move |&matches| Setting { attitudes, matches, size });
        attitudes.into_iter().flat_map(with).collect()
    }
}
