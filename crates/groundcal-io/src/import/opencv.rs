//! Camera matrix and lens under the names that OpenCV's programs, and those written after them, use: FileStorage (YAML or XML), plain
//! YAML and JSON. Pixels are counted as here.
//!
//! A file of a stereo pair holds `M1, D1, M2, D2` or `K1`, `cameraMatrix1`, `camera_matrix_left`, ...: each is a camera by the name of
//! its matrix.

use groundcal::geometry::{Intrinsics, Lens, Radtan};

use crate::{
    import::{
        imported::ImportedCamera,
        key::{is_coefficient, lens_side, matrix_side, sounds_like_a_lens},
        lens::{brown_conrady, is_fisheye, kannala_brandt},
        node::Node,
        spelling::plain as spelling,
    },
    text::{plain, quoted, some_of},
};

/// Flags of `cv2.fisheye`, the equidistant model.
const FISHEYE_FLAGS: [&str; 4] = ["fisheye_model", "is_fisheye", "fisheye", "use_fisheye"];
/// Names of the lens model.
const MODEL: [&str; 4] = ["distortion_model", "camera_model", "lens_model", "model_type"];
/// Models in x / z that are read.
const READ: [&str; 12] = [
    "plumb_bob",
    "radtan",
    "none",
    "",
    "rational_polynomial",
    "pinhole",
    "opencv",
    "brown",
    "brown_conrady",
    "radial_tangential",
    "perspective",
    "standard",
];

/// Whether there is a camera matrix.
pub(crate) fn looks_like_it(root: &Node) -> bool {
    root.entries().iter().any(|(name, value)| matrix_side(name, value).is_some())
}

/// All cameras of a file.
pub(crate) fn cameras(root: &Node) -> Result<Vec<ImportedCamera>, String> {
    named("OpenCV", root)
}

/// All cameras of a file that names them as OpenCV or ROS do.
pub(crate) fn named(format: &'static str, root: &Node) -> Result<Vec<ImportedCamera>, String> {
    let matrices: Vec<(&str, &Node, &'static str)> = root
        .entries()
        .iter()
        .filter_map(|(name, value)| Some((name.as_str(), value, matrix_side(name, value)?)))
        .collect();
    if matrices.is_empty() {
        return Err(format!("no camera_matrix; the file has the keys {}", some_of(root.keys(), 8)));
    }
    let family = family(root)?;
    let size = image_size(root)?;
    let one = matrices.len() == 1;
    let of = |(name, matrix, side): &(&str, &Node, &'static str)| {
        let intrinsics = intrinsics(name, matrix)?;
        let (lens, mut notes) = lens(root, (side, one), family, format)?;
        notes.extend(not_read(root, family));
        let camera = ImportedCamera::new(format, size, intrinsics, lens)
            .map_err(|e| if one { e } else { format!("{}: {e}", plain(name)) })?;
        Ok(camera.labelled(if one { String::new() } else { plain(name) }).noted(notes))
    };
    matrices.iter().map(of).collect()
}

/// What the coefficients are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Family {
    /// Brown-Conrady; nothing else is said.
    BrownConrady,
    /// The equidistant fisheye.
    Fisheye,
}

/// The lens model by flags and names; refuses those that are not read.
fn family(root: &Node) -> Result<Family, String> {
    if let Some(xi) = root.get(&["xi"]) {
        let value = xi.numbers().ok().and_then(|v| v.first().copied());
        return Err(format!(
            "xi is {}: the omnidirectional model, which is not read: pinhole cameras with k1, k2, p1, p2, k3 and fisheye cameras with k1, \
             k2, k3, k4 are",
            value.unwrap_or(f64::NAN)
        ));
    }
    let mut family = Family::BrownConrady;
    if FISHEYE_FLAGS.iter().any(|flag| root.get(&[flag]).is_some_and(Node::is_set)) {
        family = Family::Fisheye;
    }
    for name in MODEL {
        match root.get(&[name]).and_then(Node::text) {
            Some(model) if is_fisheye(model) => family = Family::Fisheye,
            Some(model) if !READ.contains(&model.to_ascii_lowercase().as_str()) => {
                return Err(format!(
                    "{name} is {}, which is not read: plumb_bob (k1, k2, p1, p2, k3) and equidistant (k1, k2, k3, k4) are",
                    plain(model)
                ));
            }
            _ => {}
        }
    }
    Ok(family)
}

fn intrinsics(name: &str, matrix: &Node) -> Result<Intrinsics, String> {
    let name = plain(name);
    let numbers = matrix.numbers().map_err(|e| format!("{name}: {e}"))?;
    let [fx, skew, cx, k10, fy, cy, k20, k21, k22] = numbers[..] else {
        return Err(format!("{name}: expected 3 x 3 numbers, found {}", numbers.len()));
    };
    if [k10, k20, k21, k22] != [0.0, 0.0, 0.0, 1.0] {
        return Err(format!(
            "{name}: expected [fx, skew, cx; 0, fy, cy; 0, 0, 1], found [.., .., ..; {k10}, .., ..; {k20}, {k21}, {k22}]"
        ));
    }
    Ok(Intrinsics { fx, fy, cx, cy, skew })
}

/// The lens of one side, with what to say about it.
fn lens(root: &Node, (side, one): (&str, bool), family: Family, format: &str) -> Result<(Lens, Vec<String>), String> {
    let lists: Vec<(&str, &Node)> = root
        .entries()
        .iter()
        .filter(|(name, value)| {
            value.number().is_none() && lens_side(name).is_some_and(|s| s == side || (one && s.is_empty()))
        })
        .map(|(name, value)| (name.as_str(), value))
        // A model's name may stand under `distortion`, not under `distortion_coefficients`.
        .filter(|(name, value)| {
            let word = value.text().is_some_and(|t| t.starts_with(char::is_alphabetic));
            !word || spelling(name).contains("coef")
        })
        .collect();
    let mut notes = Vec::new();
    let (name, list) = match lists[..] {
        [] => return named_coefficients(root, side, family),
        [only] => only,
        [(first, _), (second, _), ..] => {
            return Err(format!("{} and {} are both a lens. Remove one", quoted(first), quoted(second)));
        }
    };
    let numbers = list.numbers().map_err(|e| format!("{}: {e}", plain(name)))?;
    let fail = |e: String| format!("{}: {e}", plain(name));
    if family == Family::Fisheye {
        return Ok((kannala_brandt(&numbers).map_err(fail)?, notes));
    }
    if numbers.len() == 4 && format == "OpenCV" {
        notes.push(format!(
            "the four numbers of {} are read as k1, k2, p1, p2; of cv2.fisheye they would be another lens (add fisheye_model: 1)",
            plain(name)
        ));
    }
    Ok((brown_conrady(&numbers).map_err(fail)?, notes))
}

/// Coefficients as values of their own; else no lens, which is said.
fn named_coefficients(root: &Node, side: &str, family: Family) -> Result<(Lens, Vec<String>), String> {
    let at = |name: &str| root.get(&[name]).and_then(Node::number);
    let word =
        |name: &&str| root.get(&[name]).and_then(Node::text).is_some_and(|t| !t.is_empty() && at(name).is_none());
    if let Some(name) = ["k1", "k2", "k3", "k4", "p1", "p2"].iter().find(|name| side.is_empty() && word(name)) {
        return Err(format!("{name} is not a number"));
    }
    let value = |name: &str| at(name).unwrap_or(0.0);
    let names: &[&str] = match family {
        Family::BrownConrady => &["k1", "k2", "p1", "p2", "k3"],
        Family::Fisheye => &["k1", "k2", "k3", "k4"],
    };
    if side.is_empty() && names.iter().any(|n| at(n).is_some()) {
        let all = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];
        if let Some(name) = all.into_iter().find(|n| !names.contains(n) && value(n) != 0.0) {
            return Err(format!("{name} is {}: only {} are read", value(name), names.join(", ")));
        }
        let lens = match family {
            Family::BrownConrady => Lens::Radtan(Radtan::new(["k1", "k2", "p1", "p2", "k3"].map(value))),
            Family::Fisheye => kannala_brandt(&["k1", "k2", "k3", "k4"].map(value))?,
        };
        return Ok((lens, Vec::new()));
    }
    if family == Family::Fisheye {
        return Err("a fisheye lens without coefficients (distortion_coefficients: k1, k2, k3, k4)".into());
    }
    let note = "no lens distortion in the file (distortion_coefficients): taken as none".to_string();
    Ok((Lens::None, vec![note]))
}

/// A sentence about names that sound like a lens and are not read.
fn not_read(root: &Node, family: Family) -> Option<String> {
    // A list of coefficients, the single ones that are read, flags and words.
    let read = |name: &str, value: &Node| match value.number() {
        Some(_) => {
            let read: &[&str] = match family {
                Family::BrownConrady => &["k1", "k2", "k3", "p1", "p2"],
                Family::Fisheye => &["k1", "k2", "k3", "k4"],
            };
            !is_coefficient(name) || read.contains(&name.to_ascii_lowercase().as_str())
        }
        None => lens_side(name).is_some() || value.text().is_some(),
    };
    let unknown: Vec<&str> = root
        .entries()
        .iter()
        .filter(|(name, value)| sounds_like_a_lens(name) && !read(name, value))
        .map(|(name, _)| name.as_str())
        .collect();
    (!unknown.is_empty()).then(|| format!("sounds like a lens and is not read: {}", some_of(unknown, 8)))
}

fn image_size(root: &Node) -> Result<Option<[f64; 2]>, String> {
    let side = |names: &[&str]| root.get(names).and_then(Node::number);
    if let (Some(w), Some(h)) =
        (side(&["image_width", "width", "img_width", "w"]), side(&["image_height", "height", "img_height", "h"]))
    {
        return Ok(Some([w, h]));
    }
    let Some(both) = root.get(&["image_size", "img_size", "resolution", "size"]) else { return Ok(None) };
    let numbers = both.numbers().map_err(|e| format!("image_size: {e}"))?;
    match numbers[..] {
        [w, h] => Ok(Some([w, h])),
        _ => Err(format!("image_size: expected width and height, found {} numbers", numbers.len())),
    }
}
