//! Covariances and standard deviations, asked for by name.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::geometry::parameters::Parameter;

/// A covariance matrix with the names of its rows.
///
/// # Examples
/// ```
/// # use groundcal::{ImagePair, Options, Silent, calibrate_matches, synthetic::PointScene};
/// # let scene = PointScene::nominal(0);
/// # let pairs: Vec<ImagePair> = scene.pairs();
/// # let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
/// # let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
/// use groundcal::Parameter;
/// let c = &calibration.covariance;
/// assert_eq!(c.get(Parameter::Fx, Parameter::Cy), c.get(Parameter::Cy, Parameter::Fx));
/// # Ok::<(), groundcal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Covariance<P> {
    /// Names of rows and columns, in the order of the enumeration.
    pub parameters: Vec<P>,
    /// Row by row; rows of what was held are zero.
    pub matrix: Vec<Vec<f64>>,
}

/// Of nothing: not known.
impl<P> Default for Covariance<P> {
    fn default() -> Self {
        Self { parameters: Vec::new(), matrix: Vec::new() }
    }
}

impl<P: Copy + PartialEq> Covariance<P> {
    /// From its entries on and above the diagonal, rows and columns being counted in `parameters`: a covariance is symmetric to the last digit.
    pub fn from_fn(parameters: &[P], entry: impl Fn(usize, usize) -> f64) -> Self {
        let n = parameters.len();
        Self {
            parameters: parameters.to_vec(),
            matrix: (0..n).map(|r| (0..n).map(|c| entry(r.min(c), r.max(c))).collect()).collect(),
        }
    }

    /// Whether there is anything in it.
    pub(crate) fn is_known(&self) -> bool {
        !self.parameters.is_empty()
    }

    /// The covariance of two; zero where one was held or is not there.
    pub fn get(&self, a: P, b: P) -> f64 {
        let at = |p: P| self.parameters.iter().position(|q| *q == p);
        at(a).zip(at(b)).and_then(|(r, c)| self.matrix.get(r)?.get(c).copied()).unwrap_or(0.0)
    }

    /// The variance of one; zero where it was held or is not there.
    pub(crate) fn variance(&self, p: P) -> f64 {
        self.get(p, p)
    }

    /// The matrix of these, in this order.
    pub fn of(&self, parameters: &[P]) -> DMatrix<f64> {
        DMatrix::from_fn(parameters.len(), parameters.len(), |r, c| self.get(parameters[r], parameters[c]))
    }

    /// In other units: each parameter is multiplied by its factor.
    pub(crate) fn scale(&mut self, factor: impl Fn(P) -> f64) {
        let factors: Vec<f64> = self.parameters.iter().map(|p| factor(*p)).collect();
        for (row, by_row) in self.matrix.iter_mut().zip(&factors) {
            for (value, by_column) in row.iter_mut().zip(&factors) {
                *value *= by_row * by_column;
            }
        }
    }
}

/// One standard deviation of each parameter, in pixels (those of the lens: none); `None`: held fixed or given.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct StandardDeviation {
    pub fx: Option<f64>,
    pub fy: Option<f64>,
    pub cx: Option<f64>,
    pub cy: Option<f64>,
    pub skew: Option<f64>,
    pub k1: Option<f64>,
    pub k2: Option<f64>,
    #[serde(default)]
    pub p1: Option<f64>,
    #[serde(default)]
    pub p2: Option<f64>,
    #[serde(default)]
    pub k3: Option<f64>,
}

impl StandardDeviation {
    /// That of a parameter.
    pub(crate) fn get(&self, p: Parameter) -> Option<f64> {
        match p {
            Parameter::Fx => self.fx,
            Parameter::Fy => self.fy,
            Parameter::Cx => self.cx,
            Parameter::Cy => self.cy,
            Parameter::Skew => self.skew,
            Parameter::K1 => self.k1,
            Parameter::K2 => self.k2,
            Parameter::P1 => self.p1,
            Parameter::P2 => self.p2,
            Parameter::K3 => self.k3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Parameter::{Cx, Fx, Fy, K1};

    #[test]
    fn entries_are_found_by_name_and_scaled_by_name() {
        let mut c = Covariance::from_fn(&[Fx, K1], |r, s| [[4.0, 0.1], [0.1, 0.01]][r][s]);
        assert_eq!((c.get(Fx, K1), c.variance(K1), c.get(Fx, Cx)), (0.1, 0.01, 0.0));
        assert_eq!(c.of(&[K1, Fy, Fx])[(0, 2)], 0.1);
        c.scale(|p| if p == Fx { 3.0 } else { 1.0 });
        assert_eq!(c.matrix, [[36.0, 0.1 * 3.0], [0.1 * 3.0, 0.01]]);
        assert!(c.is_known() && !Covariance::<Parameter>::default().is_known());
    }
}
