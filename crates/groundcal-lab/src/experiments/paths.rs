//! Whether parallel edges on the floor are parallel in a picture: edges found to a fraction of a pixel, lines through them.
//!
//! ```text
//! edge near p, along its normal n:   argmax_s |I(p + (s + 1) n) - I(p + (s - 1) n)|,  -R <= s <= R
//! line:                              total least squares; points beyond 2.5 robust deviations left out, three times
//! ```

use groundcal::{numerics::median, vision::GrayImage};
use nalgebra::{Matrix2, Vector2};

/// How far an edge is looked for on either side of where it is expected, and the step, pixels.
const SEARCH_RANGE_PX: f64 = 5.0;
const STEP_PX: f64 = 0.25;
/// Least difference of grey values (0 to 1) across an edge.
const MIN_CONTRAST: f64 = 0.05;
/// Fewest points of a line.
const MIN_POINTS: usize = 10;

/// A straight edge as measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EdgeLine {
    /// Unit direction, pixels.
    pub(crate) direction: Vector2<f64>,
    /// Points used.
    pub(crate) points: usize,
    /// Root mean square distance from the line, pixels.
    pub(crate) rms_px: f64,
}

/// The line through the edge near a chain of expected points (pixels); `None` where too little of it is seen.
pub(crate) fn edge_line(picture: &GrayImage, expected: &[Vector2<f64>]) -> Option<EdgeLine> {
    let (first, last) = (expected.first()?, expected.last()?);
    let along = (last - first).try_normalize(1e-9)?;
    let normal = Vector2::new(-along.y, along.x);
    let found: Vec<Vector2<f64>> = expected.iter().filter_map(|p| edge_at(picture, p, &normal)).collect();
    fit(found)
}

/// The strongest edge on a short line through a point.
pub(crate) fn edge_at(picture: &GrayImage, p: &Vector2<f64>, normal: &Vector2<f64>) -> Option<Vector2<f64>> {
    let steps = (SEARCH_RANGE_PX / STEP_PX) as i64;
    let margin = (1.0 / STEP_PX) as i64;
    let values: Vec<f64> = (-steps - margin..=steps + margin)
        .map(|i| bilinear(picture, &(p + normal * (i as f64 * STEP_PX))))
        .collect::<Option<_>>()?;
    let width = 2 * margin as usize;
    let slopes: Vec<f64> = (0..values.len() - width).map(|i| (values[i + width] - values[i]).abs()).collect();
    let best = (1..slopes.len() - 1).max_by(|&i, &j| slopes[i].total_cmp(&slopes[j]))?;
    if slopes[best] < MIN_CONTRAST {
        return None;
    }
    let (before, at, after) = (slopes[best - 1], slopes[best], slopes[best + 1]);
    let curvature = before - 2.0 * at + after;
    let shift = if curvature < 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 };
    Some(p + normal * ((best as f64 - steps as f64 + shift) * STEP_PX))
}

/// Grey value between pixels; `None` outside, and where there is no picture (0, as a rectified one has beside it).
fn bilinear(picture: &GrayImage, p: &Vector2<f64>) -> Option<f64> {
    let (x, y) = (p.x.floor(), p.y.floor());
    let inside =
        x >= 0.0 && y >= 0.0 && x + 1.0 < picture.size().width as f64 && y + 1.0 < picture.size().height as f64;
    if !inside {
        return None;
    }
    let (u, v) = (p.x - x, p.y - y);
    let at = |dx: usize, dy: usize| f64::from(picture.get(x as usize + dx, y as usize + dy));
    let corners = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
    let blank = corners.contains(&0.0);
    let value = (1.0 - v) * ((1.0 - u) * corners[0] + u * corners[1]) + v * ((1.0 - u) * corners[2] + u * corners[3]);
    (!blank).then_some(value)
}

fn fit(mut points: Vec<Vector2<f64>>) -> Option<EdgeLine> {
    let mut line = None;
    for _ in 0..4 {
        if points.len() < MIN_POINTS {
            return None;
        }
        let n = points.len() as f64;
        let centre = points.iter().sum::<Vector2<f64>>() / n;
        let scatter: Matrix2<f64> = points.iter().map(|p| (p - centre) * (p - centre).transpose()).sum();
        let eigen = scatter.symmetric_eigen();
        let direction: Vector2<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
        let across = Vector2::new(-direction.y, direction.x);
        let distance = |p: &Vector2<f64>| (p - centre).dot(&across).abs();
        let rms_px = (points.iter().map(|p| distance(p).powi(2)).sum::<f64>() / n).sqrt();
        line = Some(EdgeLine { direction, points: points.len(), rms_px });
        let sigma = 1.4826 * median(&mut points.iter().map(distance).collect::<Vec<_>>());
        points.retain(|p| distance(p) <= 2.5 * sigma.max(1e-3));
    }
    line
}

/// The largest angle between any two of the lines, degrees.
pub(crate) fn largest_angle_deg(lines: &[EdgeLine]) -> f64 {
    let angle = |a: &EdgeLine, b: &EdgeLine| {
        let (d, e) = (a.direction, b.direction);
        (d.x * e.y - d.y * e.x).abs().atan2(d.dot(&e).abs()).to_degrees()
    };
    lines.iter().flat_map(|a| lines.iter().map(move |b| angle(a, b))).fold(0.0, f64::max)
}

/// The angle between any of one set of lines and any of another that is furthest from a right one, degrees off it.
pub(crate) fn furthest_from_square_deg(lines: &[EdgeLine], across: &[EdgeLine]) -> f64 {
    let off = |a: &EdgeLine, b: &EdgeLine| a.direction.dot(&b.direction).clamp(-1.0, 1.0).asin().abs().to_degrees();
    lines.iter().flat_map(|a| across.iter().map(move |b| off(a, b))).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use groundcal::geometry::ImageSize;

    /// A bright band across a grey picture, its two edges 2 degrees from parallel.
    #[test]
    fn edges_are_found_to_a_hundredth_of_a_degree() {
        let size = ImageSize::new(400, 300);
        let edges = [(60.0, 31f64), (200.0, 33f64)].map(|(y, deg)| (Vector2::new(0.0, y), deg.to_radians()));
        let side = |(p, angle): &(Vector2<f64>, f64), x: f64, y: f64| (y - p.y) * angle.cos() - (x - p.x) * angle.sin();
        let mut picture = GrayImage::filled(size, 0.0);
        for y in 0..size.height {
            for x in 0..size.width {
                // Area sampling of half planes: the pixel's edge a ramp of about a pixel.
                let cover = |e| (side(e, x as f64, y as f64) + 0.5).clamp(0.0, 1.0);
                let inside = cover(&edges[0]) * (1.0 - cover(&edges[1]));
                picture.data_mut()[y * size.width + x] = (0.3 + 0.4 * inside) as f32;
            }
        }
        let lines: Vec<EdgeLine> = edges
            .iter()
            .map(|(p, angle)| {
                let along = Vector2::new(angle.cos(), angle.sin());
                // Expected up to 2 px off, and a little turned.
                let chain: Vec<Vector2<f64>> = (20..150)
                    .map(|i| p + along * f64::from(i) + Vector2::new(0.0, 2.0 - 0.02 * f64::from(i)))
                    .collect();
                edge_line(&picture, &chain).unwrap()
            })
            .collect();
        assert!((largest_angle_deg(&lines) - 2.0).abs() < 0.02, "{lines:?}");
        assert!(lines.iter().all(|l| l.rms_px < 0.1), "{lines:?}");
        assert_eq!(edge_line(&GrayImage::filled(size, 0.5), &[Vector2::new(9.0, 9.0), Vector2::new(90.0, 9.0)]), None);
    }
}
