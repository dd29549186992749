//! Everything that can stop a calibration, with the numbers and what to do next.

/// Why there is no calibration. Every variant carries numbers; its text names the cause and a remedy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The data are malformed: a value that is not finite, a size of zero, an index out of range.
    #[error("unusable input: {0}")]
    InvalidInput(String),
    /// An option contradicts another or is out of its range.
    #[error("unusable option: {0}")]
    InvalidOption(String),
    /// Fewer than two views.
    #[error(
        "{found} image{}: a calibration needs at least two, taken from one camera attitude with a turn of 15 to 60 degrees between them. \
         Take a second image after turning (and, if you like, moving) the camera over the floor without tilting it",
        if *found == 1 { "" } else { "s" }
    )]
    TooFewImages {
        /// How many there are.
        found: usize,
    },
    /// Too few different point pairs for a homography.
    #[error(
        "{found} different {} between {from} and {to} ({given} given): a homography needs 4, and 15 or more for an error bar \
         that means something. Give more matches of points on the floor, spread over the image",
        if *found == 1 { "match" } else { "matches" }
    )]
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
    #[error(
        "the {count} points lie on a line or at fewer than four places (spread ratio {spread_ratio:.1e}): no homography follows from them. \
         Use points spread over the plane"
    )]
    DegeneratePoints {
        /// How many points there are.
        count: usize,
        /// Smallest over largest spread of the points or of the system of equations.
        spread_ratio: f64,
    },
    /// No pair of images shows a common plane.
    #[error(
        "{} a common plane: the best supported one has {best} consistent matches, {needed} are needed. \
         Check that the images belong together, overlap by half or more, and that the floor has visible texture and is in focus",
        if *pairs == 1 { "the image pair does not show".to_string() } else { format!("none of the {pairs} image pairs shows") }
    )]
    NoCommonPlane {
        /// Pairs tried.
        pairs: usize,
        /// Consistent matches of the best pair.
        best: usize,
        /// Consistent matches asked for.
        needed: usize,
    },
    /// Planes were found but none of the motions turns the camera about the plane's normal.
    #[error("no usable motion in {pairs} image pair{}: {reason}. {remedy}", if *pairs == 1 { "" } else { "s" })]
    NoUsableMotion {
        /// Pairs with a plane.
        pairs: usize,
        /// What is wrong with them, with numbers.
        reason: String,
        /// What to do next.
        remedy: String,
    },
    /// Fewer attitudes than the constraint needs.
    #[error(
        "`{constraint}` has {unknowns} unknowns and needs {needed} different camera attitudes; the {motions} motion{} \
         {} {attitudes} (motions of one attitude repeat the same two equations). \
         Tilt or roll the camera by 20 degrees and repeat a motion, or ask for less: {alternative}",
        if *motions == 1 { "" } else { "s" }, if *motions == 1 { "has" } else { "have" }
    )]
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
        alternative: String,
    },
    /// The equations have a direction that the motions do not see.
    #[error("the motions do not determine what `{constraint}` asks for: {direction}. {remedy}")]
    Undetermined {
        /// The constraint asked for.
        constraint: &'static str,
        /// The unseen direction in the user's words, with numbers.
        direction: String,
        /// What to do next.
        remedy: String,
    },
    /// The image of the absolute conic is not positive definite: no real camera fits.
    #[error(
        "no real camera fits these motions under `{constraint}`: the image of the absolute conic has eigenvalues \
         {:.3e}, {:.3e}, {:.3e} (all must have one sign). The motions are too noisy, too alike or not turns about the floor's normal. {remedy}",
        eigenvalues[0], eigenvalues[1], eigenvalues[2]
    )]
    NotPositiveDefinite {
        /// The constraint asked for.
        constraint: &'static str,
        /// Eigenvalues of the conic, largest scaled to one.
        eigenvalues: [f64; 3],
        /// What to do next.
        remedy: String,
    },
    /// The observer asked for it ([`crate::observer::Observer::stopped`]).
    #[error("stopped on request")]
    Stopped,
    /// A computation that should not fail did.
    #[error("internal numerical failure in {stage}: {detail}. Please report it with the input")]
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
}
