//! Outlines: the border of an image, polygons clipped and convex.

use nalgebra::{Vector2, Vector3};

use crate::geometry::size::ImageSize;

/// The image's outline, `per_side` points on each side: the outer edges of its pixels, clockwise as shown.
pub(super) fn border(size: ImageSize, per_side: usize) -> Vec<Vector2<f64>> {
    let (w, h) = (size.width as f64, size.height as f64);
    let corners = [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)].map(|(x, y)| Vector2::new(x - 0.5, y - 0.5));
    (0..4)
        .flat_map(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % 4]);
            (0..per_side).map(move |k| a + (b - a) * (k as f64 / per_side as f64))
        })
        .collect()
}

/// What of a polygon in homogeneous coordinates lies where `side · q >= 0` (Sutherland and Hodgman 1974).
pub(super) fn clipped(polygon: &[Vector3<f64>], side: &Vector3<f64>) -> Vec<Vector3<f64>> {
    let mut kept = Vec::with_capacity(polygon.len() + 2);
    for (i, q) in polygon.iter().enumerate() {
        let next = &polygon[(i + 1) % polygon.len()];
        let (a, b) = (side.dot(q), side.dot(next));
        if a >= 0.0 {
            kept.push(*q);
        }
        if (a >= 0.0) != (b >= 0.0) {
            kept.push(q + (next - q) * (a / (a - b)));
        }
    }
    kept
}

/// The convex hull, anticlockwise (Andrew's monotone chain).
pub(super) fn convex_hull(mut points: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = &Vector2<f64>>| {
        let mut chain: Vec<Vector2<f64>> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp(&(p - a)) <= 0.0
            {
                chain.pop();
            }
            chain.push(*p);
        }
        chain.pop();
        chain
    };
    if points.len() < 3 {
        return points;
    }
    let mut hull = half(&mut points.iter());
    hull.extend(half(&mut points.iter().rev()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_is_what_surrounds_the_points() {
        let points = [(0.0, 0.0), (2.0, 0.0), (1.0, 0.5), (2.0, 2.0), (0.0, 2.0), (1.0, 0.0), (0.0, 0.0)];
        let hull = convex_hull(points.iter().map(|(x, y)| Vector2::new(*x, *y)).collect());
        let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)];
        assert_eq!(hull, corners.map(|(x, y)| Vector2::new(x, y)));
        assert!(convex_hull(Vec::new()).is_empty());
    }
}
