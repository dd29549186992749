//! The names of a camera's numbers, and their one order.
//!
//! Everything that lists the numbers of a camera (results, covariances, files, tables) lists them in the order of
//! [`Parameter::ALL`]; priors, which know an aspect ratio instead of fy, in that of [`PriorParameter::ALL`].

use serde::{Deserialize, Serialize};

/// A number of the camera that is reported with an error bar.
///
/// # Examples
/// ```
/// use groundcal::Parameter;
/// assert_eq!((Parameter::Fx.name(), Parameter::K1.is_of_lens()), ("fx", true));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// Focal length along x, pixels.
    Fx,
    /// Focal length along y, pixels.
    Fy,
    /// Principal point, x, pixels.
    Cx,
    /// Principal point, y, pixels.
    Cy,
    /// Skew, pixels.
    Skew,
    /// Radial distortion, second order.
    K1,
    /// Radial distortion, fourth order.
    K2,
    /// Tangential distortion (decentring), along y.
    P1,
    /// Tangential distortion (decentring), along x.
    P2,
    /// Radial distortion, sixth order.
    K3,
}

impl Parameter {
    /// All, in the order of every list of them.
    pub const ALL: [Parameter; 10] = [
        Parameter::Fx,
        Parameter::Fy,
        Parameter::Cx,
        Parameter::Cy,
        Parameter::Skew,
        Parameter::K1,
        Parameter::K2,
        Parameter::P1,
        Parameter::P2,
        Parameter::K3,
    ];

    /// The name used on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Parameter::Fx => "fx",
            Parameter::Fy => "fy",
            Parameter::Cx => "cx",
            Parameter::Cy => "cy",
            Parameter::Skew => "skew",
            Parameter::K1 => "k1",
            Parameter::K2 => "k2",
            Parameter::P1 => "p1",
            Parameter::P2 => "p2",
            Parameter::K3 => "k3",
        }
    }

    /// Whether it belongs to the lens, and has no unit; the others are pixels.
    pub fn is_of_lens(self) -> bool {
        matches!(self, Parameter::K1 | Parameter::K2 | Parameter::P1 | Parameter::P2 | Parameter::K3)
    }

    /// The parameter whose prior speaks of it: of fy that of the aspect ratio.
    pub fn prior(self) -> PriorParameter {
        match self {
            Parameter::Fx => PriorParameter::Fx,
            Parameter::Fy => PriorParameter::Aspect,
            Parameter::Cx => PriorParameter::Cx,
            Parameter::Cy => PriorParameter::Cy,
            Parameter::Skew => PriorParameter::Skew,
            Parameter::K1 => PriorParameter::K1,
            Parameter::K2 => PriorParameter::K2,
            Parameter::P1 => PriorParameter::P1,
            Parameter::P2 => PriorParameter::P2,
            Parameter::K3 => PriorParameter::K3,
        }
    }
}

impl std::fmt::Display for Parameter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

/// A number of the camera that may be given a prior.
///
/// # Examples
/// ```
/// use groundcal::{Options, Parameter, PriorParameter};
/// assert_eq!(Parameter::Fy.prior(), PriorParameter::Aspect);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PriorParameter {
    /// Focal length along x, pixels.
    Fx,
    /// fy / fx.
    Aspect,
    /// Principal point, x, pixels.
    Cx,
    /// Principal point, y, pixels.
    Cy,
    /// Skew, pixels.
    Skew,
    /// Radial distortion, second order.
    K1,
    /// Radial distortion, fourth order.
    K2,
    /// Tangential distortion (decentring), along y.
    P1,
    /// Tangential distortion (decentring), along x.
    P2,
    /// Radial distortion, sixth order.
    K3,
}

impl PriorParameter {
    /// All, in the order of the camera's numbers in the joint refinement.
    pub const ALL: [PriorParameter; 10] = [
        PriorParameter::Fx,
        PriorParameter::Aspect,
        PriorParameter::Cx,
        PriorParameter::Cy,
        PriorParameter::Skew,
        PriorParameter::K1,
        PriorParameter::K2,
        PriorParameter::P1,
        PriorParameter::P2,
        PriorParameter::K3,
    ];

    /// The name used on the command line and in files.
    pub(crate) fn name(self) -> &'static str {
        match self {
            PriorParameter::Fx => "fx",
            PriorParameter::Aspect => "aspect",
            PriorParameter::Cx => "cx",
            PriorParameter::Cy => "cy",
            PriorParameter::Skew => "skew",
            PriorParameter::K1 => "k1",
            PriorParameter::K2 => "k2",
            PriorParameter::P1 => "p1",
            PriorParameter::P2 => "p2",
            PriorParameter::K3 => "k3",
        }
    }

    /// Whether it is in pixels; the others have no unit.
    pub(crate) fn is_in_pixels(self) -> bool {
        !(self == PriorParameter::Aspect || self.is_of_lens())
    }

    /// Whether it belongs to the lens.
    pub(crate) fn is_of_lens(self) -> bool {
        use PriorParameter::{K1, K2, K3, P1, P2};
        matches!(self, K1 | K2 | P1 | P2 | K3)
    }
}

impl std::fmt::Display for PriorParameter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_command_line_use_the_same_names() {
        for p in Parameter::ALL {
            assert_eq!(serde_json::to_string(&p).unwrap(), format!("\"{}\"", p.name()));
        }
        for p in PriorParameter::ALL {
            assert_eq!(serde_json::to_string(&p).unwrap(), format!("\"{}\"", p.name()));
        }
        let sorted = {
            let mut all = Parameter::ALL;
            all.sort();
            all
        };
        assert_eq!(sorted, Parameter::ALL);
    }
}
