//! Whether a semicircle on the floor is one in a picture: its edge found to a fraction of a pixel, the ellipse through it.
//!
//! ```text
//! edge:      as in `paths`, along the normal of the chain of expected points
//! ellipse:   a x² + b xy + c y² + d x + e y + f = 0, a + c = 1, of least squares; coordinates about the mean, of unit spread;
//!            points beyond 2.5 robust deviations left out, three times
//! ```

use groundcal::{numerics::median, vision::GrayImage};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use crate::experiments::paths::edge_at;

/// Fewest points of an ellipse.
const MIN_POINTS: usize = 20;

/// The edge near a chain of expected points, pixels.
pub(crate) fn edge_points(picture: &GrayImage, expected: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let inner = expected.windows(3).filter_map(|w| {
        let along = (w[2] - w[0]).try_normalize(1e-9)?;
        edge_at(picture, &w[1], &Vector2::new(-along.y, along.x))
    });
    inner.collect()
}

/// Longer over shorter axis of the ellipse through the points; `None` where they are few or on none.
pub(crate) fn axis_ratio(mut points: Vec<Vector2<f64>>) -> Option<f64> {
    let mut ratio = None;
    for _ in 0..4 {
        let (found, residuals) = fit(&points)?;
        ratio = Some(found);
        let sigma = 1.4826 * median(&mut residuals.iter().map(|r| r.abs()).collect::<Vec<_>>());
        let limit = 2.5 * sigma.max(1e-12);
        let mut of_point = residuals.iter();
        points.retain(|_| of_point.next().is_some_and(|r| r.abs() <= limit));
    }
    ratio
}

/// The ratio of the axes of the ellipse of least squares, and the residuals of its equation.
fn fit(points: &[Vector2<f64>]) -> Option<(f64, Vec<f64>)> {
    if points.len() < MIN_POINTS {
        return None;
    }
    let n = points.len() as f64;
    let centre = points.iter().sum::<Vector2<f64>>() / n;
    let spread = (points.iter().map(|p| (p - centre).norm_squared()).sum::<f64>() / n).sqrt();
    // a + c = 1: the equation is linear in (a - c, b, d, e, f), and the constant part is (x² + y²) / 2.
    let (mut normal, mut right) = (SMatrix::<f64, 5, 5>::zeros(), SVector::<f64, 5>::zeros());
    let equation = |p: &Vector2<f64>| {
        let q = (p - centre) / spread;
        let row = SVector::<f64, 5>::from([0.5 * (q.x * q.x - q.y * q.y), q.x * q.y, q.x, q.y, 1.0]);
        (row, 0.5 * q.norm_squared())
    };
    for p in points {
        let (row, constant) = equation(p);
        normal += row * row.transpose();
        right -= row * constant;
    }
    let s = normal.cholesky()?.solve(&right);
    let shape = Matrix2::new(0.5 + 0.5 * s[0], 0.5 * s[1], 0.5 * s[1], 0.5 - 0.5 * s[0]);
    let values = shape.symmetric_eigenvalues();
    let (least, greatest) = (values.min(), values.max());
    // The axes are inverse to the roots of the eigenvalues.
    let residuals = points.iter().map(equation).map(|(row, constant)| row.dot(&s) + constant).collect();
    (least > 0.0).then(|| ((greatest / least).sqrt(), residuals))
}

#[cfg(test)]
mod tests {
    use super::*;
    use groundcal::geometry::ImageSize;

    #[test]
    fn the_ratio_of_half_an_ellipse_is_found() {
        for (ratio, turn) in [(1.0, 0.0), (1.3, 0.4), (2.5, -1.1)] {
            let (sin, cos) = f64::sin_cos(turn);
            let point = |i: i32| {
                let angle = f64::from(i) * 0.03;
                let (x, y) = (60.0 * angle.cos(), 60.0 / ratio * angle.sin());
                Vector2::new(300.0 + cos * x - sin * y, 200.0 + sin * x + cos * y)
            };
            let points: Vec<Vector2<f64>> = (0..105).map(point).collect();
            assert!((axis_ratio(points.clone()).unwrap() - ratio).abs() < 1e-9);
            assert_eq!(axis_ratio(points[..19].to_vec()), None);
        }
        let line: Vec<Vector2<f64>> = (0..50).map(|i| Vector2::new(f64::from(i), 3.0)).collect();
        assert_eq!(axis_ratio(line), None);
    }

    /// A bright disc on grey, its edge a ramp of a pixel.
    #[test]
    fn a_half_circle_in_a_picture_is_round_to_a_few_thousandths() {
        let (size, centre, radius) = (ImageSize::new(200, 160), Vector2::new(98.3, 80.7), 50.0);
        let mut picture = GrayImage::filled(size, 0.0);
        for y in 0..size.height {
            for x in 0..size.width {
                let distance = (Vector2::new(x as f64, y as f64) - centre).norm();
                picture.data_mut()[y * size.width + x] = (0.3 + 0.4 * (radius - distance + 0.5).clamp(0.0, 1.0)) as f32;
            }
        }
        // Expected up to 2 px off.
        let expected: Vec<Vector2<f64>> = (0..100)
            .map(|i| {
                let angle = f64::from(i) * 0.0314;
                centre + Vector2::new(angle.cos(), angle.sin()) * (radius + 2.0 * (3.0 * angle).sin())
            })
            .collect();
        let ratio = axis_ratio(edge_points(&picture, &expected)).unwrap();
        // Edges are found in steps of a quarter pixel: of 300 draws of such errors half are within 0.0017, 19 of 20 within 0.0043.
        assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
    }
}
