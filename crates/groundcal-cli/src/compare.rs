//! `groundcal compare`: how far calibrations differ, in their parameters and in pixels.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use clap::Args;
use groundcal::{
    geometry::{
        camera_difference::{CameraDifference, camera_difference, significance},
        camera_model::CameraModel,
        size::ImageSize,
    },
    result::{Covariance, Parameter},
};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::error::CliError;
use groundcal_io::{
    export::write_whole,
    import::{self, ImportedCamera},
};
use groundcal_report::plot::{
    field::{Field, short},
    png, svg,
};

/// Pixels of the PNG for one of the canvas.
const PNG_SCALE: f64 = 2.0;
/// Beyond this many standard deviations, or below the probability of it, a difference is called significant.
const SIGNIFICANT_P: f64 = 0.0027;

/// `groundcal compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal compare result/calibration.json examples/tripod/truth.json
  groundcal compare result/ old/camera_info.yaml sparse/cameras.txt --out comparison/
  groundcal compare result/ camchain.yaml#cam1 --json

Reads calibration.json and truth.json of this program (or the folder they are in), OpenCV YAML and XML, ROS camera_info, Kalibr \
camchain.yaml, COLMAP cameras.txt and nerfstudio transforms.json; the content tells the format. FILE#NAME names one camera of \
several. Each camera is compared with the first. One whose images have another size, but the same shape, is scaled to it.

The reprojection difference is what remains when the second camera is turned to fit the first best, as it is for everybody who \
estimates the camera's pose with it.")]
pub struct CompareArgs {
    /// Two or more files of cameras; each is compared with the first
    #[arg(required = true, num_args = 2.., value_name = "FILE")]
    pub files: Vec<String>,

    /// Folder for comparison.json and the pictures difference_N.svg and .png (made if need be)
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Print the comparison as JSON on standard output and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// All comparisons with the first camera.
#[derive(Debug, Serialize)]
struct Comparisons {
    pixel_centre: &'static str,
    reference: CameraReport,
    comparisons: Vec<Comparison>,
}

#[derive(Debug, Serialize)]
struct CameraReport {
    file: String,
    format: &'static str,
    image_size: [usize; 2],
}

/// One camera against the first.
#[derive(Debug, Serialize)]
struct Comparison {
    camera: CameraReport,
    /// Size in its file where it was scaled to that of the reference.
    scaled_from: Option<[usize; 2]>,
    parameters: Vec<ParameterDifference>,
    joint: Option<Joint>,
    reprojection: Reprojection,
}

#[derive(Debug, Serialize)]
struct ParameterDifference {
    parameter: &'static str,
    unit: &'static str,
    reference: f64,
    value: f64,
    difference: f64,
    /// Of the difference; null: neither file has an error for it.
    standard_deviation: Option<f64>,
    difference_in_standard_deviations: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Joint {
    parameters: Vec<&'static str>,
    chi_squared: f64,
    degrees_of_freedom: usize,
    p_value: f64,
}

#[derive(Debug, Serialize)]
struct Reprojection {
    rms_px: f64,
    max_px: f64,
    max_at_px: [f64; 2],
    rms_without_rotation_px: f64,
    max_without_rotation_px: f64,
    rotation_deg: f64,
    /// Camera coordinates of this camera from those of the reference, row by row.
    rotation: [[f64; 3]; 3],
    /// Part of the image, 0 to 1, that both lens models reach.
    compared: f64,
}

/// A file's camera with a size that is known.
struct Camera {
    model: CameraModel,
    covariance: Option<Covariance<Parameter>>,
}

/// Runs the command; returns what goes to standard output.
pub fn run(args: &CompareArgs) -> Result<String, CliError> {
    let cameras = args.files.iter().map(|f| import::read(f)).collect::<Result<Vec<ImportedCamera>, _>>()?;
    let known = cameras.iter().find_map(|c| c.size).ok_or_else(|| {
        CliError::Input(format!(
            "{}: none of the files says the size of the images. Add image_width and image_height to one",
            args.files.join(", ")
        ))
    })?;
    let with_size = |camera: &ImportedCamera| Camera {
        model: CameraModel {
            size: camera.size.unwrap_or(known),
            intrinsics: camera.intrinsics,
            distortion: camera.distortion,
            k3: camera.k3,
        },
        covariance: camera.covariance.clone(),
    };
    let report = |i: usize, size: ImageSize| CameraReport {
        file: args.files[i].clone(),
        format: cameras[i].format,
        image_size: [size.width, size.height],
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
            pictures.push(picture(&args.files[0], &args.files[i], size, &difference));
        }
        comparisons.push(Comparison {
            camera: report(i, size),
            scaled_from,
            parameters: parameters(&reference, &camera),
            joint: joint(&reference, &camera),
            reprojection: reprojection(&difference),
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
    if let Some(out) = &args.out {
        write_files(out, &json, &pictures)?;
    }
    if args.json {
        return Ok(json);
    }
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = summary(&mut page, &all);
    Ok(page)
}

fn write_files(out: &Path, json: &str, pictures: &[Field]) -> Result<(), CliError> {
    std::fs::create_dir_all(out)
        .map_err(|e| CliError::Other(format!("cannot make the folder {}: {e}", out.display())))?;
    for (i, field) in pictures.iter().enumerate() {
        let canvas = field.layout();
        let path = |kind: &str| out.join(format!("difference_{}.{kind}", i + 1));
        write_whole(&path("svg"), svg::document(&canvas).as_bytes())?;
        write_whole(&path("png"), &png::encode(&canvas, PNG_SCALE).map_err(CliError::Other)?)?;
    }
    Ok(write_whole(&out.join("comparison.json"), json.as_bytes())?)
}

/// The camera at the reference's image size, and the size it had.
fn scaled(camera: Camera, size: ImageSize) -> Result<(Camera, Option<[usize; 2]>), String> {
    let own = camera.model.size;
    if own == size {
        return Ok((camera, None));
    }
    let (sx, sy) = (size.width as f64 / own.width as f64, size.height as f64 / own.height as f64);
    // A size scaled by one factor is off by rounding at most.
    let same_shape = (sx * own.height as f64 - size.height as f64).abs() < 1.0
        || (sy * own.width as f64 - size.width as f64).abs() < 1.0
        || (own.height as f64 - size.height as f64 / sx).abs() < 1.0;
    if !same_shape {
        return Err(format!(
            "images of {size} and {own} pixels. Cameras can be compared at one size, or where one image is the other scaled as a \
             whole (not cropped)"
        ));
    }
    let factor = |p: Parameter| match p {
        Parameter::Fx | Parameter::Cx | Parameter::Skew => sx,
        Parameter::Fy | Parameter::Cy => sy,
        Parameter::K1 | Parameter::K2 => 1.0,
    };
    let covariance = camera.covariance.map(|mut c| {
        c.scale(factor);
        c
    });
    Ok((Camera { model: camera.model.scaled_to(size), covariance }, Some([own.width, own.height])))
}

/// Ten numbers in the order of [`Parameter::ALL`], then p1, p2, k3.
fn numbers(camera: &CameraModel) -> [(&'static str, &'static str, f64); 10] {
    let (k, d) = (&camera.intrinsics, &camera.distortion);
    [
        ("fx", "px", k.fx),
        ("fy", "px", k.fy),
        ("cx", "px", k.cx),
        ("cy", "px", k.cy),
        ("skew", "px", k.skew),
        ("k1", "1", d.k1),
        ("k2", "1", d.k2),
        ("p1", "1", d.p1),
        ("p2", "1", d.p2),
        ("k3", "1", camera.k3),
    ]
}

/// Covariance of the difference: the sum, as the two are independent; a file without errors counts as exact.
fn covariance_of_difference(a: &Camera, b: &Camera) -> DMatrix<f64> {
    let n = Parameter::ALL.len();
    let of = |c: &Camera| c.covariance.as_ref().map_or(DMatrix::zeros(n, n), |m| m.of(&Parameter::ALL));
    of(a) + of(b)
}

fn parameters(a: &Camera, b: &Camera) -> Vec<ParameterDifference> {
    let covariance = covariance_of_difference(a, b);
    let pairs = numbers(&a.model).into_iter().zip(numbers(&b.model));
    pairs
        .enumerate()
        .map(|(i, ((parameter, unit, reference), (_, _, value)))| {
            let variance = if i < Parameter::ALL.len() { covariance[(i, i)] } else { 0.0 };
            let standard_deviation = (variance > 0.0).then(|| variance.sqrt());
            let difference = value - reference;
            let difference_in_standard_deviations = standard_deviation.map(|s| difference / s);
            ParameterDifference {
                parameter,
                unit,
                reference,
                value,
                difference,
                standard_deviation,
                difference_in_standard_deviations,
            }
        })
        .collect()
}

fn joint(a: &Camera, b: &Camera) -> Option<Joint> {
    let covariance = covariance_of_difference(a, b);
    let (na, nb) = (numbers(&a.model), numbers(&b.model));
    let difference = DVector::from_fn(Parameter::ALL.len(), |i, _| nb[i].2 - na[i].2);
    let s = significance(&difference, &covariance)?;
    Some(Joint {
        parameters: (0..Parameter::ALL.len())
            .filter(|i| covariance[(*i, *i)] > 0.0)
            .map(|i| Parameter::ALL[i].name())
            .collect(),
        chi_squared: s.chi_squared,
        degrees_of_freedom: s.degrees_of_freedom,
        p_value: s.p_value,
    })
}

fn reprojection(d: &CameraDifference) -> Reprojection {
    let r = &d.r_b_from_a;
    Reprojection {
        rms_px: d.rms_px,
        max_px: d.max_px,
        max_at_px: d.max_at_px.into(),
        rms_without_rotation_px: d.rms_unrotated_px,
        max_without_rotation_px: d.max_unrotated_px,
        rotation_deg: d.rotation_rad.to_degrees(),
        rotation: std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])),
        compared: d.compared,
    }
}

/// The end of a path, where it tells files apart well enough for a title.
fn tail(file: &str) -> String {
    const LONGEST: usize = 34;
    let count = file.chars().count();
    if count <= LONGEST {
        file.into()
    } else {
        format!("...{}", file.chars().skip(count + 3 - LONGEST).collect::<String>())
    }
}

fn picture(first: &str, second: &str, size: ImageSize, d: &CameraDifference) -> Field {
    Field {
        title: format!("{} against {}", tail(second), tail(first)),
        label: "difference after the best rotation, px".into(),
        size: [size.width as f64, size.height as f64],
        grid: d.grid,
        vectors: d.points.iter().map(|p| p.difference_px.map(Into::into)).collect(),
        notes: vec![
            format!(
                "Root mean square {} px, largest {} px at ({:.0}, {:.0}); rotation {} degrees.",
                short(d.rms_px),
                short(d.max_px),
                d.max_at_px.x,
                d.max_at_px.y,
                short(d.rotation_rad.to_degrees())
            ),
            format!(
                "Without a rotation: root mean square {} px, largest {} px.",
                short(d.rms_unrotated_px),
                short(d.max_unrotated_px)
            ),
        ],
    }
}

fn summary(w: &mut String, all: &Comparisons) -> std::fmt::Result {
    for (n, c) in all.comparisons.iter().enumerate() {
        let [width, height] = all.reference.image_size;
        writeln!(w, "A: {} ({}), {width} x {height} px", all.reference.file, all.reference.format)?;
        write!(w, "B: {} ({}), ", c.camera.file, c.camera.format)?;
        match c.scaled_from {
            Some([w0, h0]) => writeln!(w, "{w0} x {h0} px, scaled to {width} x {height}")?,
            None => writeln!(w, "{width} x {height} px")?,
        }
        writeln!(w, "\n{:<6}{:>14}{:>14}{:>14}{:>14}{:>14}", "", "A", "B", "B - A", "std. error", "std. errors")?;
        // Lens coefficients that neither has say nothing.
        let shown = |p: &&ParameterDifference| {
            p.reference != 0.0 || p.value != 0.0 || matches!(p.parameter, "fx" | "fy" | "cx" | "cy")
        };
        for p in c.parameters.iter().filter(shown) {
            let places = if p.unit == "px" { 3 } else { 6 };
            let optional = |v: Option<f64>, places: usize| v.map_or("-".to_string(), |v| format!("{v:.places$}"));
            writeln!(
                w,
                "{:<6}{:>14.places$}{:>14.places$}{:>+14.places$}{:>14}{:>14}",
                p.parameter,
                p.reference,
                p.value,
                p.difference,
                optional(p.standard_deviation, places),
                p.difference_in_standard_deviations.map_or("-".to_string(), |v| format!("{v:+.1}")),
            )?;
        }
        writeln!(w)?;
        match &c.joint {
            Some(j) => {
                let verdict =
                    if j.p_value < SIGNIFICANT_P { "more than their errors explain" } else { "within their errors" };
                let chi_squared = if j.chi_squared < 1e5 {
                    format!("{:.1}", j.chi_squared)
                } else {
                    format!("{:.1e}", j.chi_squared)
                };
                let p = if j.p_value < 1e-4 { "p < 0.0001".into() } else { format!("p = {:.4}", j.p_value) };
                writeln!(
                    w,
                    "Together ({}): chi-squared {chi_squared} with {} degrees of freedom, {p}: {verdict}.",
                    j.parameters.join(", "),
                    j.degrees_of_freedom,
                )?;
            }
            None => {
                writeln!(w, "Neither file has error bars (calibration.json has): the differences cannot be judged.")?
            }
        }
        let r = &c.reprojection;
        writeln!(w, "Reprojection of B against A, px:     rms      largest",)?;
        writeln!(
            w,
            "  after the best rotation {:>14.4} {:>12.4} at ({:.0}, {:.0})",
            r.rms_px, r.max_px, r.max_at_px[0], r.max_at_px[1]
        )?;
        writeln!(
            w,
            "  without a rotation      {:>14.4} {:>12.4}",
            r.rms_without_rotation_px, r.max_without_rotation_px
        )?;
        writeln!(w, "  (rotation {:.5} degrees)", r.rotation_deg)?;
        if r.compared < 1.0 {
            writeln!(
                w,
                "Over {:.1} % of the image; beyond, one of the lens models gives nothing.",
                100.0 * r.compared
            )?;
        }
        if n + 1 < all.comparisons.len() {
            writeln!(w)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use groundcal::geometry::{distortion::Distortion, intrinsics::Intrinsics};

    use super::*;
    use groundcal_report::plot::{Item, letters};

    fn camera(width: usize, height: usize) -> Camera {
        let model = CameraModel {
            size: ImageSize::new(width, height),
            intrinsics: Intrinsics::square(700.0, 400.0, 300.0),
            distortion: Distortion::default(),
            k3: 0.0,
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
        let j = joint(&a, &b).unwrap();
        assert_eq!((j.parameters, j.degrees_of_freedom), (vec!["fx", "fy"], 2));
        assert!((j.chi_squared - 9.0 / 8.0).abs() < 1e-12);
    }

    #[test]
    fn texts_of_the_picture_fit_with_the_letters_there_are() {
        let mut b = camera(800, 600).model;
        b.intrinsics.cx += 4.0;
        let d = camera_difference(&camera(800, 600).model, &b).unwrap();
        let name = "a_rather_long_folder/and_another_one/calibration.json";
        let canvas = picture(name, name, b.size, &d).layout();
        let mut texts = 0;
        for item in canvas.items {
            let Item::Text { at, text, size, anchor, upwards, .. } = item else { continue };
            assert!(text.chars().all(|c| letters::letter(c).is_some()), "{text}");
            let length = letters::write(&text).1 * size / letters::EM;
            let middle = if upwards { at[1] } else { at[0] };
            let start = match anchor {
                groundcal_report::plot::Anchor::Start => middle,
                groundcal_report::plot::Anchor::Middle => middle - 0.5 * length,
                groundcal_report::plot::Anchor::End => middle - length,
            };
            assert!(start >= 0.0 && start + length <= if upwards { canvas.height } else { canvas.width }, "{text}");
            texts += 1;
        }
        assert!(texts > 12);
    }
}
