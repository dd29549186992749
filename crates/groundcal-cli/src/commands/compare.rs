//! `groundcal compare`: how far calibrations differ, in their parameters and in pixels.

use std::path::PathBuf;

use clap::Args;
use groundcal::{
    geometry::{
        camera::{self, INTRINSIC_NAMES},
        camera_difference::{camera_difference, significance},
        lens::{Lens, Radtan},
        size::ImageSize,
    },
    result::{Covariance, Parameter},
};
use nalgebra::{DMatrix, DVector};

use crate::{
    args::OverwriteArg,
    error::CliError,
    output::{self, Finished, Results, canvas_names},
};
use groundcal_io::{
    import::{self, ImportedCamera},
    outputs::Request,
    text::plain,
};
use groundcal_report::{
    comparison::{self, ComparedCamera, Comparison, Comparisons, Joint, ParameterDifference, Reprojection},
    plot::Field,
    terminal,
};

/// `groundcal compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal compare result/calibration.json examples/tripod/truth.json
  groundcal compare result/ old/camera_info.yaml sparse/cameras.txt --out comparison/
  groundcal compare result/ camchain.yaml#cam1 --json

Reads calibration.json and truth.json of this program (or the folder they are in), OpenCV YAML and XML, ROS camera_info, Kalibr \
camchain.yaml, COLMAP cameras.txt and nerfstudio transforms.json, fisheye lenses among them; the content tells the format. FILE#NAME names one camera of \
several. Each camera is compared with the first. One whose images have another size, but the same shape, is scaled to it.

The reprojection difference is what remains when the second camera is turned to fit the first best, as it is for everybody who \
estimates the camera's pose with it.")]
pub(crate) struct CompareArgs {
    /// Two or more files of cameras; each is compared with the first
    #[arg(required = true, num_args = 2.., value_name = "FILE")]
    pub(crate) files: Vec<String>,

    /// Folder for comparison.json and the pictures difference_N.svg and .png (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,

    /// Print the comparison as JSON on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

/// A file's camera with a size that is known.
#[derive(Clone)]
struct Camera {
    model: camera::Camera,
    covariance: Option<Covariance<Parameter>>,
}

/// Compares, writes the files of `--out` and prints the comparison; what was left out is told on standard error.
pub(crate) fn run(args: &CompareArgs) -> Result<(), CliError> {
    let results = begin(args)?;
    let (text, notes, finished) = compared(args, results)?;
    for note in notes {
        output::note(&note);
    }
    output::print(&text)?;
    if let Some(finished) = finished {
        finished.tell();
    }
    Ok(())
}

/// The files of `--out`, if it is given, before the work.
fn begin(args: &CompareArgs) -> Result<Option<Results>, CliError> {
    let Some(out) = &args.out else { return Ok(None) };
    let pictures = (1..args.files.len()).flat_map(|i| canvas_names(&picture(i)));
    let names: Vec<String> = [JSON.to_string()].into_iter().chain(pictures).collect();
    let inputs: Vec<PathBuf> = args.files.iter().map(import::camera_file).collect();
    let request = Request {
        folder: out,
        command: "compare",
        names: &names,
        inputs: &inputs,
        basis: None,
        overwrite: args.overwrite.overwrite,
    };
    Results::begin(&request).map(Some)
}

/// The comparison's file.
const JSON: &str = "comparison.json";

/// Name of the picture of a camera after the first, without its ending.
fn picture(camera: usize) -> String {
    format!("difference_{camera}")
}

/// What goes to standard output, notes for standard error, and what was written.
fn compared(args: &CompareArgs, results: Option<Results>) -> Result<(String, Vec<String>, Option<Finished>), CliError> {
    let cameras = args.files.iter().map(import::read_camera).collect::<Result<Vec<ImportedCamera>, _>>()?;
    let of = |(file, camera): (&String, &ImportedCamera)| {
        camera.notes.iter().map(|n| format!("{}: {n}", plain(file))).collect::<Vec<_>>()
    };
    let notes: Vec<String> = args.files.iter().zip(&cameras).flat_map(of).collect();
    let known = cameras.iter().find_map(|c| c.size).ok_or_else(|| {
        CliError::Input(format!(
            "{}: none of the files says the size of the images. Add image_width and image_height to one",
            args.files.join(", ")
        ))
    })?;
    let with_size = |camera: &ImportedCamera| Camera {
        model: camera::Camera { size: camera.size.unwrap_or(known), intrinsics: camera.intrinsics, lens: camera.lens },
        covariance: camera.covariance.clone(),
    };
    let report = |i: usize, size: ImageSize| ComparedCamera {
        file: args.files[i].clone(),
        format: cameras[i].format,
        image_size: [size.width, size.height],
        lens: cameras[i].lens.name(),
    };
    let reference = with_size(&cameras[0]);
    let size = reference.model.size;
    let mut comparisons = Vec::new();
    let mut pictures = Vec::new();
    for (i, imported) in cameras.iter().enumerate().skip(1) {
        let camera = with_size(imported);
        let (camera, scaled_from) = scaled(camera, size)
            .map_err(|what| CliError::Input(format!("{} and {}: {what}", args.files[0], args.files[i])))?;
        let difference = camera_difference(&reference.model, &camera.model)
            .map_err(|e| CliError::Input(format!("{} and {}: {e}", args.files[0], args.files[i])))?;
        if args.out.is_some() {
            pictures.push(comparison::figure(&args.files[0], &args.files[i], size, &difference));
        }
        comparisons.push(Comparison {
            camera: report(i, size),
            scaled_from,
            parameters: parameters(&reference, &camera),
            joint: joint(&reference, &camera),
            reprojection: Reprojection::from(&difference),
        });
    }
    let all = Comparisons {
        pixel_centre: "(0,0) is the centre of the top-left pixel",
        reference: report(0, size),
        comparisons,
    };
    let json = serde_json::to_string_pretty(&all)
        .map(|text| text + "\n")
        .map_err(|e| CliError::Other(format!("cannot write the comparison as JSON: {e}")))?;
    let finished = results.map(|results| write_files(results, &json, &pictures)).transpose()?;
    if args.json {
        return Ok((json, notes, finished));
    }
    Ok((comparison::text(&all, terminal::WIDTH), notes, finished))
}

fn write_files(results: Results, json: &str, pictures: &[Field]) -> Result<Finished, CliError> {
    for (i, field) in pictures.iter().enumerate() {
        results.write_canvas(&picture(i + 1), &field.layout())?;
    }
    results.write(JSON, json.as_bytes())?;
    results.finish()
}

/// The camera at the reference's image size, and the size it had.
fn scaled(camera: Camera, size: ImageSize) -> Result<(Camera, Option<[usize; 2]>), String> {
    let own = camera.model.size;
    if own == size {
        return Ok((camera, None));
    }
    let (sx, sy) = (size.width as f64 / own.width as f64, size.height as f64 / own.height as f64);
    if !size.has_shape_of(own) {
        return Err(format!(
            "images of {size} and {own} pixels. Cameras can be compared at one size, or where one image is the other scaled as a \
             whole (not cropped)"
        ));
    }
    let factor = |p: Parameter| match p {
        Parameter::Fx | Parameter::Cx | Parameter::Skew => sx,
        Parameter::Fy | Parameter::Cy => sy,
        Parameter::K1 | Parameter::K2 | Parameter::P1 | Parameter::P2 | Parameter::K3 => 1.0,
    };
    let covariance = camera.covariance.map(|mut c| {
        c.scale(factor);
        c
    });
    Ok((Camera { model: camera.model.scaled_to(size), covariance }, Some([own.width, own.height])))
}

/// A camera's numbers by name, in their order. Without distortion a lens is Brown-Conrady's, all zero.
fn numbers(camera: &camera::Camera) -> Vec<(&'static str, f64)> {
    let lens = if camera.lens == Lens::None { Lens::Radtan(Radtan::default()) } else { camera.lens };
    let camera = camera::Camera { lens, ..*camera };
    camera.parameter_names().into_iter().zip(camera.parameters()).collect()
}

/// The numbers of both: name, that of the first, that of the second. Coefficients of different lens models have nothing in common.
fn common_numbers(a: &Camera, b: &Camera) -> Vec<(&'static str, f64, f64)> {
    let (of_a, of_b) = (numbers(&a.model), numbers(&b.model));
    let same_model = of_a.iter().map(|(name, _)| name).eq(of_b.iter().map(|(name, _)| name));
    let count = if same_model { of_a.len() } else { INTRINSIC_NAMES.len() };
    of_a.iter().zip(&of_b).take(count).map(|((name, a), (_, b))| (*name, *a, *b)).collect()
}

/// Covariance of the difference of the common numbers: the sum, as the two are independent; a file without errors counts as exact.
fn covariance_of_difference(a: &Camera, b: &Camera, names: &[&'static str]) -> DMatrix<f64> {
    let known: Vec<Option<Parameter>> =
        names.iter().map(|name| Parameter::ALL.into_iter().find(|p| p.name() == *name)).collect();
    let all = |c: &Camera| {
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

fn parameters(a: &Camera, b: &Camera) -> Vec<ParameterDifference> {
    let numbers = common_numbers(a, b);
    let names: Vec<&'static str> = numbers.iter().map(|n| n.0).collect();
    let covariance = covariance_of_difference(a, b, &names);
    let of = |(i, (parameter, reference, value)): (usize, (&'static str, f64, f64))| {
        let variance = covariance[(i, i)];
        let standard_deviation = (variance > 0.0).then(|| variance.sqrt());
        let difference = value - reference;
        ParameterDifference {
            parameter,
            unit: if i < INTRINSIC_NAMES.len() { "px" } else { "1" },
            reference,
            value,
            difference,
            standard_deviation,
            difference_in_standard_deviations: standard_deviation.map(|s| difference / s),
        }
    };
    numbers.into_iter().enumerate().map(of).collect()
}

fn joint(a: &Camera, b: &Camera) -> Option<Joint> {
    let numbers = common_numbers(a, b);
    let names: Vec<&'static str> = numbers.iter().map(|n| n.0).collect();
    let covariance = covariance_of_difference(a, b, &names);
    let difference = DVector::from_iterator(numbers.len(), numbers.iter().map(|(_, a, b)| b - a));
    let s = significance(&difference, &covariance)?;
    Some(Joint {
        parameters: (0..names.len()).filter(|i| covariance[(*i, *i)] > 0.0).map(|i| names[i]).collect(),
        chi_squared: s.chi_squared,
        degrees_of_freedom: s.degrees_of_freedom,
        p_value: s.p_value,
    })
}

#[cfg(test)]
mod tests {
    use groundcal::geometry::{intrinsics::Intrinsics, lens::Fisheye};

    use super::*;

    fn camera(width: usize, height: usize) -> Camera {
        let model = camera::Camera {
            size: ImageSize::new(width, height),
            intrinsics: Intrinsics::square(700.0, 400.0, 300.0),
            lens: Lens::None,
        };
        let covariance = Covariance::from_fn(&[Parameter::Fx, Parameter::Fy], |i, j| [[4.0, 0.0], [0.0, 9.0]][i][j]);
        Camera { model, covariance: Some(covariance) }
    }

    #[test]
    fn images_of_one_shape_are_scaled_and_others_refused() {
        let (same, from) = scaled(camera(800, 600), ImageSize::new(800, 600)).unwrap();
        assert_eq!((same.model.intrinsics.fx, from), (700.0, None));
        let (half, from) = scaled(camera(800, 600), ImageSize::new(400, 300)).unwrap();
        assert_eq!((half.model.intrinsics.fx, from), (350.0, Some([800, 600])));
        assert_eq!(half.covariance.unwrap().variance(Parameter::Fx), 1.0);
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
        let fisheye =
            Camera { model: camera::Camera { lens: Lens::Fisheye(Fisheye::default()), ..b.model }, ..b.clone() };
        let names = |a: &Camera, b: &Camera| parameters(a, b).iter().map(|p| p.parameter).collect::<Vec<_>>();
        assert_eq!(names(&a, &fisheye), INTRINSIC_NAMES);
        assert_eq!(names(&fisheye, &fisheye)[5..], ["k1", "k2", "k3", "k4"]);
        assert_eq!(names(&a, &b)[5..], ["k1", "k2", "p1", "p2", "k3"]);
        let j = joint(&a, &b).unwrap();
        assert_eq!((j.parameters, j.degrees_of_freedom), (vec!["fx", "fy"], 2));
        assert!((j.chi_squared - 9.0 / 8.0).abs() < 1e-12);
    }
}
