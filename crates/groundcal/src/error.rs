//! Everything that can stop a calibration, with the numbers and what to do next.

use crate::{
    geometry::constraint::Constraint,
    remedy::{Plain, Remedy, Wording, sentence},
};

/// Why there is no calibration. Every variant carries numbers; its text names the cause, its remedies what to do.
///
/// # Examples
/// ```
/// use groundcal::{Error, ImageSize, Options, Silent, calibrate_matches};
/// let error = calibrate_matches(&["a".into()], ImageSize::new(640, 480), &[], &Options::default(), &Silent).expect_err("one view");
/// assert_eq!(error, Error::TooFewImages { found: 1 });
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The data are malformed: a value that is not finite, a size of zero, an index out of range.
    InvalidInput(String),
    /// An option contradicts another or is out of its range.
    InvalidOption(String),
    /// Fewer than two views.
    TooFewImages {
        /// How many there are.
        found: usize,
    },
    /// Too few different point pairs for a homography.
    TooFewMatches {
        /// Name of the first image.
        from: String,
        /// Name of the second image.
        to: String,
        /// Matches given.
        given: usize,
        /// Different matches among them.
        found: usize,
    },
    /// The points cannot determine a homography.
    DegeneratePoints {
        /// How many points there are.
        count: usize,
        /// Smallest over largest spread of the points or of the system of equations.
        spread_ratio: f64,
    },
    /// No pair of images shows a common plane.
    NoCommonPlane {
        /// Pairs tried.
        pairs: usize,
        /// Consistent matches of the best pair.
        best: usize,
        /// Consistent matches asked for.
        needed: usize,
    },
    /// Planes were found but none of the motions turns the camera about the plane's normal.
    NoUsableMotion {
        /// Pairs with a plane.
        pairs: usize,
        /// What is wrong with them, with numbers.
        reason: String,
        /// What to do next: any of these.
        remedies: Vec<Remedy>,
    },
    /// Fewer attitudes than the constraint needs.
    TooFewAttitudes {
        /// The constraint asked for.
        constraint: &'static str,
        /// Its unknowns.
        unknowns: usize,
        /// Attitudes it needs.
        needed: usize,
        /// Motions found.
        motions: usize,
        /// Different attitudes among them.
        attitudes: usize,
        /// What the motions can determine.
        alternatives: Vec<Constraint>,
    },
    /// The equations have a direction that the motions do not see.
    Undetermined {
        /// The constraint asked for.
        constraint: &'static str,
        /// The unseen direction in the user's words, with numbers.
        direction: String,
        /// What to do next: any of these.
        remedies: Vec<Remedy>,
    },
    /// The image of the absolute conic is not positive definite: no real camera fits.
    NotPositiveDefinite {
        /// The constraint asked for.
        constraint: &'static str,
        /// Eigenvalues of the conic, largest scaled to one.
        eigenvalues: [f64; 3],
        /// What to do next: any of these.
        remedies: Vec<Remedy>,
    },
    /// There is a camera, but not one that can be vouched for: its refinement came to no end, leaves residuals that the noise does not, or is
    /// none that a lens could have.
    Unsound {
        /// What is wrong with it, with numbers.
        reason: String,
        /// What to do next: any of these.
        remedies: Vec<Remedy>,
    },
    /// The observer asked for it ([`crate::observer::Observer::stopped`]).
    Stopped,
    /// A computation that should not fail did.
    Numerical {
        /// Where.
        stage: &'static str,
        /// What happened.
        detail: String,
    },
}

impl Error {
    /// Whether the data were well-formed but cannot determine what was asked.
    pub fn is_degenerate(&self) -> bool {
        !matches!(self, Error::InvalidInput(_) | Error::InvalidOption(_) | Error::Numerical { .. } | Error::Stopped)
    }

    /// Short name, stable across versions.
    pub fn code(&self) -> &'static str {
        match self {
            Error::InvalidInput(_) => "unusable_input",
            Error::InvalidOption(_) => "unusable_option",
            Error::TooFewImages { .. } => "too_few_images",
            Error::TooFewMatches { .. } => "too_few_matches",
            Error::DegeneratePoints { .. } => "degenerate_points",
            Error::NoCommonPlane { .. } => "no_common_plane",
            Error::NoUsableMotion { .. } => "no_usable_motion",
            Error::TooFewAttitudes { .. } => "too_few_attitudes",
            Error::Undetermined { .. } => "undetermined",
            Error::NotPositiveDefinite { .. } => "not_positive_definite",
            Error::Unsound { .. } => "unsound",
            Error::Stopped => "stopped",
            Error::Numerical { .. } => "numerical",
        }
    }

    /// What is wrong, with numbers.
    pub(crate) fn finding(&self) -> String {
        let plural = |n: usize| if n == 1 { "" } else { "s" };
        match self {
            Error::InvalidInput(what) => format!("unusable input: {what}"),
            Error::InvalidOption(what) => format!("unusable option: {what}"),
            Error::Stopped => "stopped on request".to_string(),
            Error::TooFewImages { found } => format!(
                "{found} image{}: a calibration needs at least two, taken from one camera attitude with a turn of 15 to 60 degrees \
                 between them",
                plural(*found)
            ),
            Error::TooFewMatches { from, to, given, found } => format!(
                "{found} different {} between {from} and {to} ({given} given): a homography needs 4, and 15 or more for an error bar that \
                 means something",
                if *found == 1 { "match" } else { "matches" }
            ),
            Error::DegeneratePoints { count, spread_ratio } => format!(
                "the {count} points lie on a line or at fewer than four places (spread ratio {spread_ratio:.1e}): no homography follows \
                 from them"
            ),
            Error::NoCommonPlane { pairs, best, needed } => {
                let none = match pairs {
                    1 => "the image pair does not show".to_string(),
                    n => format!("none of the {n} image pairs shows"),
                };
                format!(
                    "{none} a common plane: the best supported one has {best} consistent matches, {needed} are needed"
                )
            }
            Error::NoUsableMotion { pairs, reason, .. } => {
                format!("no usable motion in {pairs} image pair{}: {reason}", plural(*pairs))
            }
            Error::TooFewAttitudes { constraint, unknowns, needed, motions, attitudes, .. } => format!(
                "`{constraint}` has {unknowns} unknowns and needs {needed} different camera attitudes; the {motions} motion{} {} \
                 {attitudes} (motions of one attitude repeat the same two equations)",
                plural(*motions),
                if *motions == 1 { "has" } else { "have" }
            ),
            Error::Undetermined { constraint, direction, .. } => {
                format!("the motions do not determine what `{constraint}` asks for: {direction}")
            }
            Error::NotPositiveDefinite { constraint, eigenvalues: [a, b, c], .. } => format!(
                "no real camera fits these motions under `{constraint}`: the image of the absolute conic has eigenvalues {a:.3e}, {b:.3e}, \
                 {c:.3e} (all must have one sign). The motions are too noisy, too alike or not turns about the floor's normal"
            ),
            Error::Unsound { reason, .. } => format!("no camera that can be vouched for: {reason}"),
            Error::Numerical { stage, detail } => format!("internal numerical failure in {stage}: {detail}"),
        }
    }

    /// What to do about it: any of these.
    pub fn remedies(&self) -> Vec<Remedy> {
        match self {
            Error::InvalidInput(_) | Error::InvalidOption(_) | Error::Stopped => Vec::new(),
            Error::TooFewImages { .. } => vec![Remedy::TakeSecondImage],
            Error::TooFewMatches { .. } => vec![Remedy::MoreMatches],
            Error::DegeneratePoints { .. } => vec![Remedy::SpreadPoints],
            Error::NoCommonPlane { .. } => vec![Remedy::CheckImages],
            Error::NoUsableMotion { remedies, .. }
            | Error::Undetermined { remedies, .. }
            | Error::Unsound { remedies, .. }
            | Error::NotPositiveDefinite { remedies, .. } => remedies.clone(),
            Error::TooFewAttitudes { alternatives, .. } => {
                vec![Remedy::TiltOrRoll { deg: 20.0 }, Remedy::UseConstraint { any_of: alternatives.clone() }]
            }
            Error::Numerical { .. } => vec![Remedy::ReportFault],
        }
    }

    /// Finding and remedies as a front end words them.
    pub fn message(&self, wording: &dyn Wording) -> String {
        sentence(&self.finding(), &self.remedies(), wording)
    }
}

/// In the library's own words.
impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message(&Plain))
    }
}

impl std::error::Error for Error {}
