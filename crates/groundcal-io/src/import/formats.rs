//! The table of formats: what tells each, and what reads it.

use crate::{
    import::{
        colmap, groundcal_json, imported::ImportedCamera, json, kalibr, nerfstudio, node::Node, opencv, ros, truth_json,
    },
    text::some_of,
};

/// What is read, for messages.
pub(crate) const READ: &str = "calibration.json and truth.json of this program, OpenCV (YAML, XML or JSON), ROS camera_info, Kalibr camchain, \
                               COLMAP cameras.txt and transforms.json are read";

/// A format: whether a tree is of it, and its cameras.
struct Format {
    is: fn(&Node) -> bool,
    cameras: fn(&Node) -> Result<Vec<ImportedCamera>, String>,
}

/// Formats in JSON beside this program's own, in the order in which they are tried.
const JSON: [Format; 3] = [
    Format { is: is_transforms, cameras: nerfstudio::cameras },
    Format { is: is_truth, cameras: truth_json::cameras },
    Format { is: opencv::looks_like_it, cameras: opencv::cameras },
];
/// Formats in YAML.
const YAML: [Format; 3] = [
    Format { is: kalibr::looks_like_it, cameras: kalibr::cameras },
    Format { is: ros::looks_like_it, cameras: ros::cameras },
    Format { is: opencv::looks_like_it, cameras: opencv::cameras },
];

fn has(root: &Node, name: &str) -> bool {
    root.keys().any(|k| k == name)
}

fn is_transforms(root: &Node) -> bool {
    ["fl_x", "frames", "camera_angle_x"].iter().any(|n| has(root, n))
}

fn is_truth(root: &Node) -> bool {
    has(root, "image_size") && has(root, "fx")
}

/// All cameras of a text, one at least.
pub(crate) fn parse(text: &str) -> Result<Vec<ImportedCamera>, String> {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    if text.is_empty() {
        return Err(format!("the file is empty. {READ}"));
    }
    if text.starts_with('{') {
        return parse_json(text);
    }
    if text.starts_with('<') {
        return opencv::cameras(&Node::from_xml(text)?);
    }
    if colmap::looks_like_it(text) {
        return colmap::cameras(text);
    }
    let root = Node::from_yaml(text)?;
    if let Some(format) = YAML.iter().find(|f| (f.is)(&root)) {
        return (format.cameras)(&root);
    }
    let found = if root.keys().next().is_none() {
        "text without named values".to_string()
    } else {
        format!("the keys {}", some_of(root.keys(), 8))
    };
    Err(format!(
        "no calibration: expected camera_matrix (OpenCV, ROS), cam0 (Kalibr) or lines of COLMAP cameras.txt, found {found}. {READ}"
    ))
}

fn parse_json(text: &str) -> Result<Vec<ImportedCamera>, String> {
    let value = json::value(text)?;
    if groundcal_json::looks_like_it(&value) {
        return groundcal_json::camera(value).map(|c| vec![c]);
    }
    let root = Node::from_json(value);
    match JSON.iter().find(|f| (f.is)(&root)) {
        Some(format) => (format.cameras)(&root),
        None => Err(format!(
            "JSON, but neither calibration.json (format_version), truth.json (image_size, fx), transforms.json (fl_x) nor a camera_matrix. \
             {READ}"
        )),
    }
}
