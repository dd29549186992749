//! Where the absolute conic's points lie, and how well the attitudes are spread (KZR, "conditioning issues").
//!
//! The floor's circular points are seen at e = K A (1, ±i, 0)ᵀ: two complex conjugate points on the horizon. Divided by its third
//! coordinate, e = m ± i d with the real point m of the horizon that lies midway and d along the horizon. Each gives two
//! equations eᵀ ω e = 0 on ω = K⁻ᵀK⁻¹; the singular values of their derivatives by (ln fx, ln fy/fx, cx, cy, skew) tell how
//! well the attitudes together determine each combination of them, whatever the noise.

use groundcal::{
    geometry::{Frame, rotation_cam_from_world},
    result::{AttitudeReport, Calibration, Parameter},
    start::residual_by_camera,
};
use nalgebra::{Complex, DMatrix, Vector2, Vector3};
use serde::Serialize;

type ComplexPoint = Vector3<Complex<f64>>;

/// The absolute conic's part of the report.
#[derive(Debug, Serialize)]
pub(crate) struct Conic {
    pub(crate) attitudes: Vec<ConicAttitude>,
    /// Camera numbers left free, of `ln fx`, `ln fy/fx`, `cx`, `cy`, `skew`.
    pub(crate) unknowns: Vec<&'static str>,
    /// Equations that the attitudes give: two each.
    pub(crate) equations: usize,
    /// Singular values of those equations, largest first, in units of the largest; one for each unknown.
    pub(crate) singular_values: Vec<f64>,
    /// The combination that the attitudes tell least: parts of the unknowns, unit length (cx, cy, skew in half image sides).
    pub(crate) weakest: Vec<f64>,
    /// Largest difference of pitch, and of roll (modulo 180 degrees), in degrees.
    pub(crate) pitch_spread_deg: f64,
    pub(crate) roll_spread_deg: f64,
}

/// An attitude, the camera's.
#[derive(Debug, Serialize)]
pub(crate) struct ConicAttitude {
    pub(crate) pitch_down_deg: f64,
    pub(crate) roll_deg: f64,
    /// a x + b y + c = 0 in ideal pixels, a² + b² = 1.
    pub(crate) horizon_px: Option<[f64; 3]>,
    /// m and d of the circular points m ± i d, ideal pixels.
    pub(crate) circular_points: Option<[[f64; 2]; 2]>,
    /// The same of each motion by itself, as measured.
    pub(crate) measured: Vec<[[f64; 2]; 2]>,
    /// Pitch and roll of each of its views, degrees.
    pub(crate) views: Vec<[f64; 2]>,
    /// Names of the images of its motions.
    pub(crate) motions: Vec<[String; 2]>,
}

/// m and d of a complex point given in homogeneous coordinates; d's sign is made positive along x.
fn real_and_imaginary(e: &ComplexPoint) -> Option<[[f64; 2]; 2]> {
    let (x, y) = (e.x / e.z, e.y / e.z);
    let sign = if x.im < 0.0 { -1.0 } else { 1.0 };
    let point = [[x.re, y.re], [sign * x.im, sign * y.im]];
    point.iter().flatten().all(|v| v.is_finite() && v.abs() < 1e9).then_some(point)
}

fn circular_point(c: &Calibration, a: &AttitudeReport) -> ComplexPoint {
    let rotation = rotation_cam_from_world(a.pitch_down_deg.to_radians(), a.roll_deg.to_radians(), 0.0);
    let k = c.camera.model().intrinsics.matrix();
    let [re, im] = [0, 1].map(|i| k * rotation.column(i));
    Vector3::new(Complex::new(re.x, im.x), Complex::new(re.y, im.y), Complex::new(re.z, im.z))
}

/// From a calibration; `None` where there is no floor.
pub(crate) fn conic(c: &Calibration) -> Option<Conic> {
    if c.attitudes.is_empty() {
        return None;
    }
    let attitudes = c
        .attitudes
        .iter()
        .enumerate()
        .map(|(i, a)| {
            let pairs = || a.motions.iter().filter_map(|&m| c.evidence.pairs.get(m));
            ConicAttitude {
                pitch_down_deg: a.pitch_down_deg,
                roll_deg: a.roll_deg,
                horizon_px: a.horizon_px,
                circular_points: real_and_imaginary(&circular_point(c, a)),
                measured: pairs()
                    .filter_map(|p| {
                        let e = p.circular_point?.map(|[re, im]| Complex::new(re, im));
                        real_and_imaginary(&Vector3::from(e))
                    })
                    .collect(),
                views: c
                    .views
                    .iter()
                    .filter(|v| v.attitude == Some(i))
                    .map(|v| [v.pitch_down_deg, v.roll_deg])
                    .collect(),
                motions: a
                    .motions
                    .iter()
                    .filter_map(|&m| c.motions.get(m))
                    .map(|m| [m.from.clone(), m.to.clone()])
                    .collect(),
            }
        })
        .collect();
    let (unknowns, singular_values, weakest) = conditioning(c);
    let spread = |values: &[f64], modulus: Option<f64>| {
        let apart = |a: f64, b: f64| match modulus {
            Some(m) => {
                let d = (a - b).rem_euclid(m);
                d.min(m - d)
            }
            None => (a - b).abs(),
        };
        values.iter().flat_map(|a| values.iter().map(move |b| apart(*a, *b))).fold(0.0, f64::max)
    };
    let of = |f: fn(&AttitudeReport) -> f64| c.attitudes.iter().map(f).collect::<Vec<_>>();
    Some(Conic {
        attitudes,
        unknowns,
        equations: 2 * c.attitudes.len(),
        singular_values,
        weakest,
        pitch_spread_deg: spread(&of(|a| a.pitch_down_deg), None),
        roll_spread_deg: spread(&of(|a| a.roll_deg), Some(180.0)),
    })
}

/// Names of the free numbers, singular values of the attitudes' equations in units of the largest, and the weakest combination.
fn conditioning(c: &Calibration) -> (Vec<&'static str>, Vec<f64>, Vec<f64>) {
    let names = ["ln fx", "ln fy/fx", "cx", "cy", "skew"];
    let m = c.covariance.of(&Parameter::ALL);
    let (fx, fy) = (c.camera.fx, c.camera.fy);
    let ratio = m[(0, 0)] / (fx * fx) + m[(1, 1)] / (fy * fy) - 2.0 * m[(0, 1)] / (fx * fy);
    // An aspect ratio that is held leaves rounding only.
    let free =
        [m[(0, 0)] > 0.0, ratio > 1e-9 * m[(0, 0)] / (fx * fx), m[(2, 2)] > 0.0, m[(3, 3)] > 0.0, m[(4, 4)] > 0.0];
    let columns: Vec<usize> = (0..5).filter(|&i| free[i]).collect();
    let frame = Frame::new(c.camera.model().size, None);
    let intrinsics = c.camera.model().intrinsics;
    let mut equations = DMatrix::<f64>::zeros(2 * c.attitudes.len(), columns.len());
    for (a, attitude) in c.attitudes.iter().enumerate() {
        let by = residual_by_camera(&frame, &intrinsics, &circular_point(c, attitude));
        for (column, &i) in columns.iter().enumerate() {
            equations[(2 * a, column)] = by[(0, i)];
            equations[(2 * a + 1, column)] = by[(1, i)];
        }
    }
    let unknowns = columns.iter().map(|&i| names[i]).collect();
    let square = equations.tr_mul(&equations);
    if columns.is_empty() || !square.iter().all(|v| v.is_finite()) {
        return (unknowns, Vec::new(), Vec::new());
    }
    let eigen = square.symmetric_eigen();
    let mut order: Vec<usize> = (0..columns.len()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let largest = eigen.eigenvalues[order[0]].max(f64::MIN_POSITIVE);
    let values = order.iter().map(|&i| (eigen.eigenvalues[i].max(0.0) / largest).sqrt()).collect();
    let last = eigen.eigenvectors.column(order[order.len() - 1]);
    // Its sign is free: the largest part is made positive.
    let sign = last.iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).map_or(1.0, |v| v.signum());
    (unknowns, values, last.iter().map(|v| v * sign).collect())
}

/// The horizon of a view in the picture, lens and all: pieces of a curve inside `window` (left, top, right, bottom in pixels), and the
/// point of it nearest to the principal point, if the lens reaches that far.
pub(crate) fn horizon(c: &Calibration, pitch_down_deg: f64, roll_deg: f64, window: [f64; 4]) -> Vec<Vec<[f64; 2]>> {
    const STEPS: i32 = 160;
    let camera = c.camera.model();
    let world = rotation_cam_from_world(pitch_down_deg.to_radians(), roll_deg.to_radians(), 0.0);
    let up = world.column(2);
    let level = up.xy().norm();
    if level < 1e-6 {
        return Vec::new();
    }
    // In normalised coordinates: up · (x, y, 1) = 0, from its foot outwards.
    let foot = up.xy() * (-up.z / (level * level));
    let along = Vector2::new(-up.y, up.x) / level;
    let reach = 4.0 * (window[2] - window[0]).max(window[3] - window[1]) / camera.intrinsics.fx;
    let mut pieces: Vec<Vec<[f64; 2]>> = vec![Vec::new()];
    for i in -STEPS..=STEPS {
        let p = foot + along * (reach * f64::from(i) / f64::from(STEPS));
        // Beyond its fold the lens model says nothing.
        let inside =
            |p: &Vector2<f64>| (window[0]..=window[2]).contains(&p.x) && (window[1]..=window[3]).contains(&p.y);
        match (camera.project(&p.push(1.0)).filter(inside), pieces.last_mut()) {
            (Some(pixel), Some(piece)) => piece.push(pixel.into()),
            (None, Some(piece)) if !piece.is_empty() => pieces.push(Vec::new()),
            _ => {}
        }
    }
    pieces.retain(|p| p.len() > 1);
    pieces
}
