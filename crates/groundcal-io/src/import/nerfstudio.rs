//! transforms.json (nerfstudio, instant-ngp). Pixels are counted from the corner of the image: cx and cy less ½ are ours.
//!
//! The camera stands at the top of the file or with each frame; a frame's own values win. Frames of one camera are one camera;
//! several are named by the first picture of each.

use std::collections::HashMap;

use groundcal::geometry::{Intrinsics, Lens, Radtan};

use crate::{
    import::{
        imported::ImportedCamera,
        key::sounds_like_a_lens,
        lens::{is_fisheye, kannala_brandt},
        node::Node,
    },
    text::{plain, some_of},
};

/// Values of a camera.
const KEYS: [&str; 19] = [
    "camera_model",
    "is_fisheye",
    "w",
    "h",
    "fl_x",
    "fl_y",
    "cx",
    "cy",
    "k1",
    "k2",
    "k3",
    "k4",
    "k5",
    "k6",
    "p1",
    "p2",
    "camera_angle_x",
    "camera_angle_y",
    "skew",
];
/// Models in x / z that are read.
const MODELS: [&str; 7] = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "perspective", ""];
/// Cameras that a file may have.
const MAX_CAMERAS: usize = 10_000;

/// A camera's values: those of a frame, then those of the top.
struct Values<'a> {
    frame: Option<&'a Node>,
    top: &'a Node,
}

impl<'a> Values<'a> {
    fn get(&self, name: &str) -> Option<&'a Node> {
        let exact = |node: &'a Node| node.entries().iter().find(|(k, _)| k == name).map(|(_, v)| v);
        // A value of null is no value.
        let given = |v: &&Node| !matches!(v, Node::Text(t) if t.is_empty());
        self.frame.and_then(exact).filter(given).or_else(|| exact(self.top).filter(given))
    }

    fn number(&self, name: &str) -> Result<Option<f64>, String> {
        match self.get(name) {
            None => Ok(None),
            Some(Node::Number(v)) => Ok(Some(*v)),
            Some(_) => Err(format!("{name} is not a number")),
        }
    }

    fn required(&self, name: &str) -> Result<f64, String> {
        self.number(name)?.ok_or_else(|| format!("no {name}, neither at the top of the file nor with the frames"))
    }
}

/// All cameras of the file.
pub(crate) fn cameras(root: &Node) -> Result<Vec<ImportedCamera>, String> {
    let frames = match root.get(&["frames"]) {
        Some(Node::List(frames)) => frames.as_slice(),
        _ => &[],
    };
    let has_own = |frame: &Node| frame.keys().any(|k| KEYS.contains(&k));
    if !frames.iter().any(has_own) {
        return Ok(vec![camera(&Values { frame: None, top: root })?]);
    }
    let mut found: Vec<ImportedCamera> = Vec::new();
    let mut known: HashMap<String, ()> = HashMap::new();
    for (i, frame) in frames.iter().enumerate() {
        let values = Values { frame: Some(frame), top: root };
        // The numbers as text: equal ones are one camera.
        let identity = KEYS.map(|k| values.get(k).map_or_else(String::new, |v| format!("{v:?}"))).join(",");
        if known.insert(identity, ()).is_some() {
            continue;
        }
        let name = frame.get(&["file_path"]).and_then(Node::text).unwrap_or_default();
        let fail = |e: String| format!("frames[{i}] ({}): {e}", plain(name));
        if found.len() >= MAX_CAMERAS {
            return Err(fail(format!("more than {MAX_CAMERAS} cameras")));
        }
        found.push(camera(&values).map_err(fail)?.labelled(name));
    }
    if let [only] = &mut found[..] {
        only.label.clear();
    }
    Ok(found)
}

fn camera(values: &Values) -> Result<ImportedCamera, String> {
    let lens = lens(values)?;
    let size = [values.required("w")?, values.required("h")?];
    let mut notes = Vec::new();
    let (fx, fy) = focal_lengths(values, size, &mut notes)?;
    let mut centre = |name: &str, side: f64| -> Result<f64, String> {
        let given = values.number(name)?;
        if given.is_none() {
            notes.push(format!("no {name} in the file: taken as the middle of the image"));
        }
        Ok(given.unwrap_or(0.5 * side) - 0.5)
    };
    let (cx, cy) = (centre("cx", size[0])?, centre("cy", size[1])?);
    let of = values.frame.into_iter().chain([values.top]);
    let unknown: Vec<&str> =
        of.flat_map(|node| node.keys()).filter(|k| !KEYS.contains(k) && sounds_like_a_lens(k)).collect();
    if !unknown.is_empty() {
        notes.push(format!("sounds like a lens and is not read: {}", some_of(unknown, 8)));
    }
    let intrinsics = Intrinsics { fx, fy, cx, cy, skew: values.number("skew")?.unwrap_or(0.0) };
    let camera = ImportedCamera::new("transforms.json", Some(size), intrinsics, lens)?;
    Ok(camera.noted(notes))
}

/// The lens: k1 to k4 of a fisheye, or k1, k2, p1, p2, k3.
fn lens(values: &Values) -> Result<Lens, String> {
    let mut fisheye = values.get("is_fisheye").is_some_and(Node::is_set);
    if let Some(model) = values.get("camera_model") {
        let model = model.text().unwrap_or_default();
        fisheye |= is_fisheye(model);
        if !is_fisheye(model) && !MODELS.contains(&model) {
            return Err(format!(
                "camera_model is {}, which is not read: OPENCV, PINHOLE and OPENCV_FISHEYE are",
                plain(model)
            ));
        }
    }
    let coefficient = |name: &str| values.number(name).map(|v| v.unwrap_or(0.0));
    let (of, beyond): ([&str; 5], &[&str]) = if fisheye {
        (["k1", "k2", "k3", "k4", ""], &["k5", "k6", "p1", "p2"])
    } else {
        (["k1", "k2", "p1", "p2", "k3"], &["k4", "k5", "k6"])
    };
    for name in beyond {
        if coefficient(name)? != 0.0 {
            let read = of.join(", ");
            return Err(format!("{name} is {}: only {} are read", coefficient(name)?, read.trim_end_matches(", ")));
        }
    }
    let [a, b, c, d, e] = of.map(coefficient);
    let [a, b, c, d, e] = [a?, b?, c?, d?, e?];
    if fisheye { kannala_brandt(&[a, b, c, d]) } else { Ok(Lens::Radtan(Radtan::new([a, b, c, d, e]))) }
}

/// fl_x and fl_y, or those of the angles of view.
fn focal_lengths(values: &Values, [w, h]: [f64; 2], notes: &mut Vec<String>) -> Result<(f64, f64), String> {
    let of_angle = |name: &str, side: f64| -> Result<Option<f64>, String> {
        let Some(angle) = values.number(name)? else { return Ok(None) };
        if !(angle > 0.0 && angle < std::f64::consts::PI) {
            return Err(format!("{name} is {angle}: expected an angle of view between 0 and pi"));
        }
        Ok(Some(0.5 * side / (0.5 * angle).tan()))
    };
    let fx = match values.number("fl_x")? {
        Some(fx) => fx,
        None => match of_angle("camera_angle_x", w)? {
            Some(fx) => fx,
            None => return values.required("fl_x").map(|f| (f, f)),
        },
    };
    let fy = match values.number("fl_y")? {
        Some(fy) => fy,
        None => match of_angle("camera_angle_y", h)? {
            Some(fy) => fy,
            None => {
                notes.push("no fl_y in the file: taken as fl_x".to_string());
                fx
            }
        },
    };
    Ok((fx, fy))
}
