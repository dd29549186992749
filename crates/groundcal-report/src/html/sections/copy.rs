//! The camera to be copied: as text, for NumPy and OpenCV, as YAML.

use groundcal::{geometry::Lens, result::Calibration};

use crate::{canvas::svg::escape, number::trimmed};

/// More digits than any error bar asks for.
fn digits(value: f64) -> String {
    let text = format!("{value:.9}");
    let text = trimmed(&text);
    if text == "-0" { "0".into() } else { text.into() }
}

fn list(values: &[f64]) -> String {
    values.iter().map(|v| digits(*v)).collect::<Vec<_>>().join(", ")
}

/// OpenCV's and ROS's name of the lens model, and its coefficients; `None` where they have none.
fn coefficients(lens: &Lens) -> Option<(&'static str, Vec<f64>)> {
    match lens {
        Lens::None => Some(("plumb_bob", vec![0.0; 5])),
        Lens::Radtan(_) => {
            let of = |name: &str| lens.parameter(name).unwrap_or(0.0);
            Some(("plumb_bob", ["k1", "k2", "p1", "p2", "k3"].map(of).to_vec()))
        }
        Lens::Fisheye(_) => Some(("equidistant", lens.parameters().to_vec())),
        _ => None,
    }
}

fn as_text(c: &Calibration) -> String {
    let k = &c.camera;
    let number = |v: f64| format!("{v:.3}");
    let cells = [
        [number(k.fx), number(k.skew), number(k.cx)],
        ["0".into(), number(k.fy), number(k.cy)],
        ["0", "0", "1"].map(String::from),
    ];
    let wide = cells.iter().flatten().map(String::len).max().unwrap_or(0);
    let row = |r: &[String; 3]| r.iter().map(|v| format!("{v:>wide$}")).collect::<Vec<_>>().join("  ");
    let lens = k.model().lens;
    let named: Vec<String> = lens
        .parameter_names()
        .iter()
        .zip(lens.parameters())
        .map(|(name, value)| format!("{name} {}", digits(value)))
        .collect();
    let lens =
        if named.is_empty() { "lens: none".into() } else { format!("lens: {}\n{}", lens.name(), named.join("\n")) };
    format!("{}\n{lens}", cells.iter().map(row).collect::<Vec<_>>().join("\n"))
}

fn as_numpy(c: &Calibration) -> String {
    let k = &c.camera;
    let matrix =
        format!("K = np.array([[{}], [{}], [0, 0, 1]])", list(&[k.fx, k.skew, k.cx]), list(&[0.0, k.fy, k.cy]));
    match coefficients(&k.model().lens) {
        Some(("equidistant", d)) => format!("{matrix}\ndist = np.array([{}])  # cv2.fisheye", list(&d)),
        Some((_, d)) => format!("{matrix}\ndist = np.array([{}])", list(&d)),
        None => format!("{matrix}\n# OpenCV has no lens model {}", k.model().lens.name()),
    }
}

fn as_yaml(c: &Calibration) -> String {
    let k = &c.camera;
    let matrix = list(&[k.fx, k.skew, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0]);
    let lens = match coefficients(&k.model().lens) {
        Some((model, d)) => {
            format!(
                "distortion_model: {model}\ndistortion_coefficients:\n  rows: 1\n  cols: {}\n  data: [{}]",
                d.len(),
                list(&d)
            )
        }
        None => format!("# no such lens model: {}", k.model().lens.name()),
    };
    let [w, h] = k.image_size;
    format!("image_width: {w}\nimage_height: {h}\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [{matrix}]\n{lens}")
}

/// One form shown, the others folded.
pub(crate) fn block(c: &Calibration) -> String {
    let forms = [("Text", as_text(c)), ("NumPy", as_numpy(c)), ("YAML (OpenCV, ROS)", as_yaml(c))];
    let lines = |text: &str| text.lines().map(escape).collect::<Vec<_>>().join("\n");
    let form = |(i, (name, text)): (usize, (&str, String))| {
        let open = if i == 0 { " open" } else { "" };
        format!(
            "<details name=\"copy\"{open}><summary>{name}</summary><div class=\"code\"><pre tabindex=\"0\">{}</pre><button type=\"button\" data-copy>Copy\
             </button></div></details>\n",
            lines(&text)
        )
    };
    let all: String = forms.into_iter().enumerate().map(form).collect();
    format!("<div class=\"copy\" aria-label=\"Camera to copy\">\n{all}</div>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_whole_and_short() {
        assert_eq!(
            (digits(705.0), digits(-0.0), digits(1e-12), digits(0.0001234)),
            ("705".into(), "0".into(), "0".into(), "0.0001234".into())
        );
        assert_eq!(list(&[1.0, -2.5]), "1, -2.5");
    }
}
