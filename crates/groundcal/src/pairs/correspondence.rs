//! Point pairs between two images.

use nalgebra::Vector2;

use crate::{error::Error, geometry::size::ImageSize, numerics::statistics::median};

/// A point of the plane seen in two images; pixels, (0, 0) the centre of the top-left pixel.
///
/// # Examples
/// ```
/// use groundcal::PointMatch;
/// // Twice as uncertain as the others.
/// let m = PointMatch { sigma_px: 2.0, ..PointMatch::new([10.0, 20.0], [12.0, 19.5]) };
/// assert_eq!(m.b.y, 19.5);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointMatch {
    /// Where it is in the first image, in pixels.
    pub a: Vector2<f64>,
    /// Where it is in the second image, in pixels.
    pub b: Vector2<f64>,
    /// Standard deviation of each of the four coordinates relative to the other matches (the common scale is estimated
    /// from the residuals).
    pub sigma_px: f64,
}

impl PointMatch {
    /// A match of unit weight.
    pub fn new(a: [f64; 2], b: [f64; 2]) -> Self {
        Self { a: Vector2::new(a[0], a[1]), b: Vector2::new(b[0], b[1]), sigma_px: 1.0 }
    }
}

/// The matches of a pair of images.
///
/// # Examples
/// ```
/// use groundcal::{ImagePair, PointMatch};
/// let pair = ImagePair { from: 0, to: 1, matches: vec![PointMatch::new([10.0, 20.0], [12.0, 19.5])] };
/// assert_eq!(pair.matches[0].sigma_px, 1.0);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ImagePair {
    /// Index of the first image.
    pub from: usize,
    /// Index of the second image.
    pub to: usize,
    /// Matches from the first to the second.
    pub matches: Vec<PointMatch>,
}

/// Checks every match (finite, plausibly inside the image, positive sigma) and drops exact repetitions, which carry no
/// information and would shrink the error bars. The order of first appearance is kept; deviations are divided by their median.
pub fn validated(matches: &[PointMatch], size: ImageSize) -> Result<Vec<PointMatch>, Error> {
    // Points may lie a little outside (sub-pixel corners at the border, undistorted points), not far outside.
    let margin = 0.5 * (size.width + size.height) as f64;
    let inside = |p: &Vector2<f64>| {
        p.x > -margin && p.y > -margin && p.x < size.width as f64 + margin && p.y < size.height as f64 + margin
    };
    for (index, m) in matches.iter().enumerate() {
        let finite = m.a.iter().chain(m.b.iter()).all(|v| v.is_finite());
        if !finite {
            return Err(Error::InvalidInput(format!("match {index} has a coordinate that is not a finite number")));
        }
        if !(m.sigma_px.is_finite() && m.sigma_px > 0.0) {
            return Err(Error::InvalidInput(format!(
                "match {index} has sigma_px = {}, which must be a positive number",
                m.sigma_px
            )));
        }
        if !inside(&m.a) || !inside(&m.b) {
            return Err(Error::InvalidInput(format!(
                "match {index} ({:.1}, {:.1}) -> ({:.1}, {:.1}) lies far outside an image of {size} pixels; check the image size",
                m.a.x, m.a.y, m.b.x, m.b.y
            )));
        }
    }
    let key = |m: &PointMatch| [m.a.x, m.a.y, m.b.x, m.b.y].map(f64::to_bits);
    let mut seen = std::collections::HashSet::with_capacity(matches.len());
    let mut different: Vec<PointMatch> = matches.iter().filter(|m| seen.insert(key(m))).copied().collect();
    // Deviations are relative: what they have in common is estimated from the residuals.
    let common = median(&mut different.iter().map(|m| m.sigma_px).collect::<Vec<_>>());
    for m in &mut different {
        m.sigma_px /= common;
    }
    Ok(different)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repetitions_are_dropped_and_bad_values_refused() {
        let size = ImageSize::new(640, 480);
        let good = PointMatch::new([1.0, 2.0], [3.0, 4.0]);
        let other = PointMatch::new([5.0, 2.0], [3.0, 4.0]);
        assert_eq!(validated(&[good, other, good, good], size).as_deref(), Ok(&[good, other][..]));
        let nan = PointMatch::new([f64::NAN, 2.0], [3.0, 4.0]);
        assert!(matches!(validated(&[good, nan], size), Err(Error::InvalidInput(text)) if text.contains("match 1")));
        let far = PointMatch::new([1e5, 2.0], [3.0, 4.0]);
        assert!(validated(&[far], size).is_err());
        assert!(validated(&[PointMatch { sigma_px: 0.0, ..good }], size).is_err());
    }
}
