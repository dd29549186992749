//! How far cameras differ: the numbers as data, as text for the terminal, and as a figure.

use groundcal::geometry::{CameraDifference, ImageSize};
use serde::Serialize;

use crate::{
    number::{fixed, or_dash, three_digits},
    plot::Field,
    terminal::{Table, wrapped},
};

/// Below this probability a difference is called significant: three standard deviations of one number.
const SIGNIFICANT_P: f64 = 0.0027;

/// Cameras, each against the first.
#[derive(Debug, Clone, Serialize)]
pub struct Comparisons {
    /// Pixel convention of all coordinates.
    pub pixel_centre: &'static str,
    /// The first camera.
    pub reference: ComparedCamera,
    /// The others.
    pub comparisons: Vec<Comparison>,
}

/// Where a camera comes from.
#[derive(Debug, Clone, Serialize)]
pub struct ComparedCamera {
    /// Its file.
    pub file: String,
    /// Name of the file's format.
    pub format: &'static str,
    /// Width and height in pixels.
    pub image_size: [usize; 2],
    /// Name of its lens model.
    pub lens: &'static str,
}

/// One camera against the first.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// It.
    pub camera: ComparedCamera,
    /// Size in its file where it was scaled to that of the reference.
    pub scaled_from: Option<[usize; 2]>,
    /// Number by number.
    pub parameters: Vec<ParameterDifference>,
    /// All numbers that have errors together.
    pub joint: Option<Joint>,
    /// In pixels.
    pub reprojection: Reprojection,
}

/// How far a number differs.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterDifference {
    /// Its name.
    pub parameter: &'static str,
    /// `px`, or `1` where it has none.
    pub unit: &'static str,
    /// The first camera's.
    pub reference: f64,
    /// This camera's.
    pub value: f64,
    /// This less the first.
    pub difference: f64,
    /// Of the difference; `None`: neither file has an error for it.
    pub standard_deviation: Option<f64>,
    /// The difference over it.
    pub difference_in_standard_deviations: Option<f64>,
}

/// A test of all numbers that have errors.
#[derive(Debug, Clone, Serialize)]
pub struct Joint {
    /// Their names.
    pub parameters: Vec<&'static str>,
    /// Sum of squares in standard deviations, correlations accounted for.
    pub chi_squared: f64,
    /// Of it.
    pub degrees_of_freedom: usize,
    /// Probability that errors alone make it so large.
    pub p_value: f64,
}

/// How far the image of one and the same ray differs.
#[derive(Debug, Clone, Serialize)]
pub struct Reprojection {
    /// Root mean square after the best rotation, pixels.
    pub rms_px: f64,
    /// Largest after the best rotation.
    pub max_px: f64,
    /// Where that is.
    pub max_at_px: [f64; 2],
    /// Root mean square as the cameras are.
    pub rms_without_rotation_px: f64,
    /// Largest as the cameras are.
    pub max_without_rotation_px: f64,
    /// Angle of the best rotation.
    pub rotation_deg: f64,
    /// Camera coordinates of this camera from those of the reference, row by row.
    pub rotation: [[f64; 3]; 3],
    /// Part of the image, 0 to 1, that both lens models reach.
    pub compared: f64,
}

impl From<&CameraDifference> for Reprojection {
    fn from(d: &CameraDifference) -> Self {
        let r = &d.r_b_from_a;
        Self {
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
}

/// The comparisons for people.
pub fn text(all: &Comparisons, width: usize) -> String {
    all.comparisons.iter().map(|c| text_of(all, c, width)).collect::<Vec<_>>().join("\n")
}

fn text_of(all: &Comparisons, c: &Comparison, width: usize) -> String {
    let [w, h] = all.reference.image_size;
    let size = match c.scaled_from {
        Some([w0, h0]) => format!("{w0} x {h0} px, scaled to {w} x {h}"),
        None => format!("{w} x {h} px"),
    };
    let r = &c.reprojection;
    let has_lens_rows = c.parameters.iter().any(|p| p.unit != "px");
    let other_lens = if has_lens_rows {
        String::new()
    } else {
        let text =
            format!("Their lens models, {} and {}, have no coefficients in common.", all.reference.lens, c.camera.lens);
        wrapped(&text, 0, width) + "\n"
    };
    let reach = if r.compared < 1.0 {
        let text = format!(
            "Over {} % of the image; beyond, one of the lens models gives nothing.",
            fixed(100.0 * r.compared, 1)
        );
        wrapped(&text, 0, width) + "\n"
    } else {
        String::new()
    };
    format!(
        "A: {} ({}), {w} x {h} px\nB: {} ({}), {size}\n\n{}{other_lens}\n{}\n{}\n{}(rotation {} degrees)\n{reach}",
        all.reference.file,
        all.reference.format,
        c.camera.file,
        c.camera.format,
        parameters(&c.parameters).text(width),
        wrapped(&verdict(c.joint.as_ref()), 0, width),
        wrapped("Reprojection of B against A, px:", 0, width),
        reprojection(r).text(width),
        fixed(r.rotation_deg, 5)
    )
}

fn parameters(all: &[ParameterDifference]) -> Table {
    let mut table =
        Table::new().name("").number("A").number("B").number("B - A").number("std. error").number("std. errors");
    // Lens coefficients that neither has say nothing.
    let shown = |p: &&ParameterDifference| {
        p.reference != 0.0 || p.value != 0.0 || matches!(p.parameter, "fx" | "fy" | "cx" | "cy")
    };
    for p in all.iter().filter(shown) {
        let decimals = if p.unit == "px" { 3 } else { 6 };
        table.row([
            p.parameter.into(),
            fixed(p.reference, decimals),
            fixed(p.value, decimals),
            format!("{:+.decimals$}", p.difference),
            or_dash(p.standard_deviation, decimals),
            p.difference_in_standard_deviations.map_or("-".into(), |v| format!("{v:+.1}")),
        ]);
    }
    table
}

fn verdict(joint: Option<&Joint>) -> String {
    let Some(j) = joint else {
        return "Neither file has error bars (calibration.json has): the differences cannot be judged.".into();
    };
    let verdict = if j.p_value < SIGNIFICANT_P { "more than their errors explain" } else { "within their errors" };
    let chi_squared = if j.chi_squared < 1e5 { fixed(j.chi_squared, 1) } else { format!("{:.1e}", j.chi_squared) };
    let p = if j.p_value < 1e-4 { "p < 0.0001".into() } else { format!("p = {}", fixed(j.p_value, 4)) };
    format!(
        "Together ({}): chi-squared {chi_squared} with {} degrees of freedom, {p}: {verdict}.",
        j.parameters.join(", "),
        j.degrees_of_freedom,
    )
}

fn reprojection(r: &Reprojection) -> Table {
    let mut table = Table::new().name("").number("rms").number("largest").note("");
    let [x, y] = r.max_at_px.map(|v| fixed(v, 0));
    let largest = format!("at ({x}, {y})");
    table.row(["after the best rotation".into(), fixed(r.rms_px, 4), fixed(r.max_px, 4), largest]);
    let [rms, max] = [r.rms_without_rotation_px, r.max_without_rotation_px].map(|v| fixed(v, 4));
    table.row(["without a rotation".into(), rms, max]);
    table
}

/// The difference over the image, of a camera against a reference, by their files.
pub fn figure(reference: &str, camera: &str, size: ImageSize, d: &CameraDifference) -> Field {
    let [x, y] = [d.max_at_px.x, d.max_at_px.y].map(|v| fixed(v, 0));
    Field {
        title: format!("{} against {}", tail(camera), tail(reference)),
        label: "difference after the best rotation, px".into(),
        size: [size.width as f64, size.height as f64],
        grid: d.grid,
        vectors: d.differences_px.iter().map(|d| d.map(Into::into)).collect(),
        notes: vec![
            format!(
                "Root mean square {} px, largest {} px at ({x}, {y}); rotation {} degrees.",
                three_digits(d.rms_px),
                three_digits(d.max_px),
                three_digits(d.rotation_rad.to_degrees())
            ),
            format!(
                "Without a rotation: root mean square {} px, largest {} px.",
                three_digits(d.rms_unrotated_px),
                three_digits(d.max_unrotated_px)
            ),
        ],
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

#[cfg(test)]
mod tests {
    use groundcal::geometry::{Camera, Intrinsics, Lens, camera_difference};

    use super::*;

    fn moved() -> CameraDifference {
        let a = Camera {
            size: ImageSize::new(800, 600),
            intrinsics: Intrinsics::square(700.0, 400.0, 300.0),
            lens: Lens::None,
        };
        let mut b = a;
        b.intrinsics.cx += 4.0;
        camera_difference(&a, &b).unwrap()
    }

    #[test]
    fn texts_of_the_picture_fit_with_the_letters_there_are() {
        let name = "a_rather_long_folder/and_another_one/calibration.json";
        let canvas = figure(name, name, ImageSize::new(800, 600), &moved()).layout();
        let texts = canvas.texts(1.0);
        for text in &texts {
            let side = canvas.view[if text.upwards { 3 } else { 2 }];
            assert!(text.has_letters && text.along[0] >= 0.0 && text.along[1] <= side, "{text:?}");
        }
        assert!(texts.len() > 12);
    }

    #[test]
    fn the_text_says_what_differs_and_whether_it_matters() {
        let camera = |file: &str| ComparedCamera {
            file: file.into(),
            format: "groundcal",
            image_size: [800, 600],
            lens: "none",
        };
        let fx = ParameterDifference {
            parameter: "fx",
            unit: "px",
            reference: 700.0,
            value: 703.0,
            difference: 3.0,
            standard_deviation: Some(2.0),
            difference_in_standard_deviations: Some(1.5),
        };
        let k1 = ParameterDifference { parameter: "k1", unit: "1", reference: 0.0, value: 0.0, ..fx.clone() };
        let comparison = Comparison {
            camera: camera("b.json"),
            scaled_from: Some([400, 300]),
            parameters: vec![fx, k1],
            joint: Some(Joint { parameters: vec!["fx"], chi_squared: 2.25, degrees_of_freedom: 1, p_value: 0.13 }),
            reprojection: Reprojection { compared: 0.9, ..Reprojection::from(&moved()) },
        };
        let all = Comparisons {
            pixel_centre: "",
            reference: camera("a.json"),
            comparisons: vec![comparison.clone(), Comparison { joint: None, ..comparison }],
        };
        let page = text(&all, 80);
        for words in [
            "B: b.json (groundcal), 400 x 300 px, scaled to 800 x 600\n",
            "fx  700.000  703.000  +3.000       2.000         +1.5\n",
            "Together (fx): chi-squared 2.2 with 1 degrees of freedom, p = 0.1300: within their errors.\n",
            "Over 90.0 % of the image",
            "\n\nA: a.json",
            "Neither file has error bars",
        ] {
            assert!(
                page.contains(words) || page.split_whitespace().collect::<Vec<_>>().join(" ").contains(words.trim()),
                "{words}\n{page}"
            );
        }
        assert!(!page.contains("k1"), "{page}");
    }
}
