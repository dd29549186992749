//! How far one camera is from another: their numbers, all errors of both together, and the images of the same rays.

use groundcal::{
    Error,
    geometry::{CameraDifference, ImageSize, Intrinsics, Lens, Radtan, camera_difference},
    numerics::chi_squared_survival,
    result::{Covariance, Parameter},
};
use nalgebra::{DMatrix, DVector};

use crate::comparison::{ComparedCamera, Comparison, Comparisons, Joint, ParameterDifference, Reprojection};

/// A camera to be compared.
#[derive(Debug, Clone)]
pub struct Camera {
    /// Its file, or what it is called.
    pub name: String,
    /// Name of the file's format.
    pub format: &'static str,
    /// Width and height in pixels; `None`: not said, that of the others.
    pub size: Option<ImageSize>,
    /// Camera matrix in pixels.
    pub intrinsics: Intrinsics,
    /// Lens.
    pub lens: Lens,
    /// Covariance, where it has errors.
    pub covariance: Option<Covariance<Parameter>>,
}

/// Why cameras cannot be compared.
#[derive(Debug, Clone, PartialEq)]
pub enum CompareError {
    /// None of them says the size of its images.
    NoSize,
    /// The first and this one have images of different shapes; in words.
    Shapes(usize, String),
    /// The library's word on the first and this one.
    Camera(usize, Error),
}

/// The cameras, each against the first, and the differences themselves, for figures.
///
/// # Errors
/// [`CompareError`].
pub fn compare(cameras: &[Camera]) -> Result<(Comparisons, Vec<CameraDifference>), CompareError> {
    let known = cameras.iter().find_map(|c| c.size).ok_or(CompareError::NoSize)?;
    let [first, others @ ..] = cameras else { return Err(CompareError::NoSize) };
    let report = |camera: &Camera, size: ImageSize| ComparedCamera {
        file: camera.name.clone(),
        format: camera.format,
        image_size: [size.width, size.height],
        lens: camera.lens.name(),
    };
    let reference = OfSize::of(first, known);
    let size = reference.model.size;
    let (mut comparisons, mut differences) = (Vec::new(), Vec::new());
    for (i, other) in others.iter().enumerate().map(|(i, other)| (i + 1, other)) {
        let (camera, scaled_from) =
            scaled(OfSize::of(other, known), size).map_err(|what| CompareError::Shapes(i, what))?;
        let difference = camera_difference(&reference.model, &camera.model).map_err(|e| CompareError::Camera(i, e))?;
        comparisons.push(Comparison {
            camera: report(other, size),
            scaled_from,
            parameters: parameters(&reference, &camera),
            joint: joint(&reference, &camera),
            reprojection: Reprojection::from(&difference),
        });
        differences.push(difference);
    }
    let all = Comparisons {
        pixel_centre: "(0,0) is the centre of the top-left pixel",
        reference: report(first, size),
        comparisons,
    };
    Ok((all, differences))
}

/// A camera with a size that is known.
#[derive(Clone)]
struct OfSize {
    model: groundcal::geometry::Camera,
    covariance: Option<Covariance<Parameter>>,
}

impl OfSize {
    fn of(camera: &Camera, known: ImageSize) -> Self {
        let size = camera.size.unwrap_or(known);
        let model = groundcal::geometry::Camera { size, intrinsics: camera.intrinsics, lens: camera.lens };
        Self { model, covariance: camera.covariance.clone() }
    }
}

/// The camera at the reference's image size, and the size it had.
fn scaled(camera: OfSize, size: ImageSize) -> Result<(OfSize, Option<[usize; 2]>), String> {
    let own = camera.model.size;
    if own == size {
        return Ok((camera, None));
    }
    let (sx, sy) = (size.width as f64 / own.width as f64, size.height as f64 / own.height as f64);
    let Some(model) = camera.model.scaled_to(size) else {
        return Err(format!(
            "images of {size} and {own} pixels. Cameras can be compared at one size, or where one image is the other scaled as a \
             whole (not cropped)"
        ));
    };
    let factor = |p: Parameter| match p {
        Parameter::Fx | Parameter::Cx | Parameter::Skew => sx,
        Parameter::Fy | Parameter::Cy => sy,
        Parameter::K1 | Parameter::K2 | Parameter::P1 | Parameter::P2 | Parameter::K3 => 1.0,
    };
    let covariance = camera.covariance.map(|c| {
        let entry = |i: usize, j: usize| c.matrix[i][j] * factor(c.parameters[i]) * factor(c.parameters[j]);
        Covariance::from_fn(&c.parameters, entry)
    });
    Ok((OfSize { model, covariance }, Some([own.width, own.height])))
}

/// Names of the numbers of the camera matrix, which every lens model has.
fn matrix_names() -> impl Iterator<Item = &'static str> {
    Parameter::ALL.into_iter().filter(|p| !p.is_of_lens()).map(Parameter::name)
}

/// A camera's numbers by name, in their order. Without distortion a lens is Brown-Conrady's, all zero.
fn numbers(camera: &groundcal::geometry::Camera) -> Vec<(&'static str, f64)> {
    let lens = if camera.lens == Lens::None { Lens::Radtan(Radtan::default()) } else { camera.lens };
    let k = &camera.intrinsics;
    let of_matrix = matrix_names().zip([k.fx, k.fy, k.cx, k.cy, k.skew]);
    of_matrix.chain(lens.parameter_names().iter().copied().zip(lens.parameters())).collect()
}

/// The numbers of both: name, that of the first, that of the second. Coefficients of different lens models have nothing in common.
fn common_numbers(a: &OfSize, b: &OfSize) -> Vec<(&'static str, f64, f64)> {
    let (of_a, of_b) = (numbers(&a.model), numbers(&b.model));
    let same_model = of_a.iter().map(|(name, _)| name).eq(of_b.iter().map(|(name, _)| name));
    let count = if same_model { of_a.len() } else { matrix_names().count() };
    of_a.iter().zip(&of_b).take(count).map(|((name, a), (_, b))| (*name, *a, *b)).collect()
}

/// Covariance of the difference of the common numbers: the sum, as the two are independent; a file without errors counts as exact.
fn covariance_of_difference(a: &OfSize, b: &OfSize, names: &[&'static str]) -> DMatrix<f64> {
    let known: Vec<Option<Parameter>> =
        names.iter().map(|name| Parameter::ALL.into_iter().find(|p| p.name() == *name)).collect();
    let all = |c: &OfSize| {
        let n = Parameter::ALL.len();
        c.covariance.as_ref().map_or(DMatrix::zeros(n, n), |m| m.of(&Parameter::ALL))
    };
    let sum = all(a) + all(b);
    let at = |p: Parameter| Parameter::ALL.iter().position(|q| *q == p);
    DMatrix::from_fn(names.len(), names.len(), |i, j| {
        let place = known[i].and_then(at).zip(known[j].and_then(at));
        place.map_or(0.0, |(i, j)| sum[(i, j)])
    })
}

fn parameters(a: &OfSize, b: &OfSize) -> Vec<ParameterDifference> {
    let numbers = common_numbers(a, b);
    let names: Vec<&'static str> = numbers.iter().map(|n| n.0).collect();
    let covariance = covariance_of_difference(a, b, &names);
    let of = |(i, (parameter, reference, value)): (usize, (&'static str, f64, f64))| {
        let variance = covariance[(i, i)];
        let standard_deviation = (variance > 0.0).then(|| variance.sqrt());
        let difference = value - reference;
        ParameterDifference {
            parameter,
            unit: if i < matrix_names().count() { "px" } else { "1" },
            reference,
            value,
            difference,
            standard_deviation,
            difference_in_standard_deviations: standard_deviation.map(|s| difference / s),
        }
    };
    numbers.into_iter().enumerate().map(of).collect()
}

fn joint(a: &OfSize, b: &OfSize) -> Option<Joint> {
    let numbers = common_numbers(a, b);
    let names: Vec<&'static str> = numbers.iter().map(|n| n.0).collect();
    let covariance = covariance_of_difference(a, b, &names);
    let difference = DVector::from_iterator(numbers.len(), numbers.iter().map(|(_, a, b)| b - a));
    jointly(&names, &difference, &covariance)
}

/// Whether numbers differ by more than their errors: the squared Mahalanobis distance dᵀ C⁻¹ d, chi-squared distributed, C the sum of the
/// covariances of two independent sides. Numbers without variance (held on both sides) have no part. `None` where none has an error, or
/// the covariance is singular.
fn jointly(names: &[&'static str], difference: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<Joint> {
    let free: Vec<usize> = (0..difference.len()).filter(|&i| covariance[(i, i)] > 0.0).collect();
    if free.is_empty() {
        return None;
    }
    // Pixels and lens coefficients differ in size by many orders: correlations are inverted.
    let sigma = |i: usize| covariance[(i, i)].sqrt();
    let scaled = DVector::from_iterator(free.len(), free.iter().map(|&i| difference[i] / sigma(i)));
    let correlation = DMatrix::from_fn(free.len(), free.len(), |r, c| {
        let (i, j) = (free[r], free[c]);
        covariance[(i, j)] / (sigma(i) * sigma(j))
    });
    let chi_squared = scaled.dot(&correlation.cholesky()?.solve(&scaled));
    let degrees_of_freedom = free.len();
    chi_squared.is_finite().then(|| Joint {
        parameters: free.iter().map(|i| names[*i]).collect(),
        chi_squared,
        degrees_of_freedom,
        p_value: chi_squared_survival(chi_squared, degrees_of_freedom),
    })
}

#[cfg(test)]
mod tests {
    use groundcal::geometry::Fisheye;

    use super::*;

    fn camera(width: usize, height: usize) -> OfSize {
        let model = groundcal::geometry::Camera {
            size: ImageSize::new(width, height),
            intrinsics: Intrinsics::square(700.0, 400.0, 300.0),
            lens: Lens::None,
        };
        let covariance = Covariance::from_fn(&[Parameter::Fx, Parameter::Fy], |i, j| [[4.0, 0.0], [0.0, 9.0]][i][j]);
        OfSize { model, covariance: Some(covariance) }
    }

    #[test]
    fn images_of_one_shape_are_scaled_and_others_refused() {
        let (same, from) = scaled(camera(800, 600), ImageSize::new(800, 600)).unwrap();
        assert_eq!((same.model.intrinsics.fx, from), (700.0, None));
        let (half, from) = scaled(camera(800, 600), ImageSize::new(400, 300)).unwrap();
        assert_eq!((half.model.intrinsics.fx, from), (350.0, Some([800, 600])));
        assert_eq!(half.covariance.unwrap().get(Parameter::Fx, Parameter::Fx), 1.0);
        // 1000 x 667 at a third is 333 x 222.
        assert!(scaled(camera(1000, 667), ImageSize::new(333, 222)).is_ok());
        let message = scaled(camera(800, 600), ImageSize::new(800, 450)).err().unwrap();
        assert!(message.contains("800") && message.contains("450") && message.contains("cropped"), "{message}");
    }

    #[test]
    fn errors_of_both_sides_add_up() {
        let (a, mut b) = (camera(800, 600), camera(800, 600));
        b.model.intrinsics.fx += 3.0;
        let all = parameters(&a, &b);
        assert_eq!(all[0].standard_deviation, Some(8f64.sqrt()));
        assert_eq!(all[0].difference_in_standard_deviations, Some(3.0 / 8f64.sqrt()));
        assert_eq!(all[2].standard_deviation, None);
        // Another lens model leaves the camera matrix to be compared.
        let fisheye = OfSize {
            model: groundcal::geometry::Camera { lens: Lens::Fisheye(Fisheye::default()), ..b.model },
            ..b.clone()
        };
        let names = |a: &OfSize, b: &OfSize| parameters(a, b).iter().map(|p| p.parameter).collect::<Vec<_>>();
        assert_eq!(names(&a, &fisheye), ["fx", "fy", "cx", "cy", "skew"]);
        assert_eq!(names(&fisheye, &fisheye)[5..], ["k1", "k2", "k3", "k4"]);
        assert_eq!(names(&a, &b)[5..], ["k1", "k2", "p1", "p2", "k3"]);
        let j = joint(&a, &b).unwrap();
        assert_eq!((j.parameters, j.degrees_of_freedom), (vec!["fx", "fy"], 2));
        assert!((j.chi_squared - 9.0 / 8.0).abs() < 1e-12);
    }

    #[test]
    fn the_mahalanobis_distance_leaves_out_what_is_held() {
        let covariance = DMatrix::from_row_slice(3, 3, &[4.0, 0.0, 3.0, 0.0, 0.0, 0.0, 3.0, 0.0, 9.0]);
        let s = jointly(&["fx", "fy", "cx"], &DVector::from_vec(vec![2.0, 7.0, 3.0]), &covariance).unwrap();
        // (1, 1) under a correlation of one half: 2 (1 - ½) / (1 - ¼).
        assert!((s.chi_squared - 4.0 / 3.0).abs() < 1e-12);
        assert_eq!((s.degrees_of_freedom, s.parameters), (2, vec!["fx", "cx"]));
        assert!((s.p_value - (-2.0f64 / 3.0).exp()).abs() < 1e-9);
        assert!(jointly(&["fx"], &DVector::from_vec(vec![1.0]), &DMatrix::zeros(1, 1)).is_none());
    }
}
