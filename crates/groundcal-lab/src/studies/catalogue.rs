//! All studies by their names.

use crate::{
    error::LabError,
    progress::Progress,
    studies::{
        figure4,
        reports::{self, output::StudyOutput},
        setting::Asked,
    },
};

/// A study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Study {
    /// One of the paper's figure 4.
    Figure4(figure4::Study),
    /// Radial distortion of one parameter.
    Radial,
    /// One motion transferred into other views.
    Transfer,
    /// All subsets of twelve motions.
    Subsets,
    /// Any motion before a plane.
    General,
}

impl Study {
    /// All of them, those of the paper's figure 4 first.
    pub fn all() -> Vec<Study> {
        let of_figure4 = figure4::Study::ALL.into_iter().map(Study::Figure4);
        of_figure4.chain([Study::Radial, Study::Transfer, Study::Subsets, Study::General]).collect()
    }

    /// Its name in tables, messages and file names.
    pub fn name(self) -> &'static str {
        match self {
            Study::Figure4(study) => study.name(),
            Study::Radial => "radial",
            Study::Transfer => "transfer",
            Study::Subsets => "subsets",
            Study::General => "general",
        }
    }

    /// Whether it varies the image noise, which then cannot be asked for.
    pub fn varies_noise(self) -> bool {
        matches!(self, Study::Figure4(figure4::Study::Noise) | Study::Radial)
    }

    /// Whether rolls can be asked for: views from anywhere are rolled by any angle.
    pub fn knows_rolls(self) -> bool {
        self != Study::General
    }

    /// Runs so many trials for each point of a curve, under its own settings or those asked for. The seed decides every random choice; the number of threads changes nothing.
    ///
    /// # Errors
    /// [`LabError::Other`] when the table cannot be written.
    pub fn run(self, asked: &Asked, trials: u32, seed: u64, progress: &dyn Progress) -> Result<StudyOutput, LabError> {
        match self {
            Study::Figure4(study) => reports::figure4::run(study, asked, trials, seed, progress),
            Study::Radial => reports::radial::run(asked, trials, seed, progress),
            Study::Transfer => reports::transfer::run(asked, trials, seed, progress),
            Study::Subsets => reports::subsets::run(asked, trials, seed, progress),
            Study::General => reports::general::run(asked, trials, seed, progress),
        }
    }
}
