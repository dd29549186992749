//! Kalibr's camchain.yaml: cam0, cam1, ... Pixels are counted as here.

use groundcal::geometry::{Intrinsics, Lens};

use crate::{
    import::{
        imported::ImportedCamera,
        lens::{brown_conrady, is_fisheye, kannala_brandt},
        node::Node,
    },
    text::{plain, quoted, some_of},
};

/// Whether a value is named camN and holds intrinsics.
pub(crate) fn looks_like_it(root: &Node) -> bool {
    !cameras_of(root).is_empty()
}

fn cameras_of(root: &Node) -> Vec<(&str, &Node)> {
    let named = |k: &str| k.strip_prefix("cam").is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()));
    root.entries().iter().filter(|(k, v)| named(k) && matches!(v, Node::Map(_))).map(|(k, v)| (k.as_str(), v)).collect()
}

/// All cameras of the chain.
pub(crate) fn cameras(root: &Node) -> Result<Vec<ImportedCamera>, String> {
    cameras_of(root)
        .into_iter()
        .map(|(name, node)| camera(node).map(|c| c.labelled(name)).map_err(|e| format!("{name}: {e}")))
        .collect()
}

fn camera(node: &Node) -> Result<ImportedCamera, String> {
    let word = |name: &str| node.get(&[name]).and_then(Node::text).unwrap_or_default();
    let numbers = |name: &str| match node.get(&[name]) {
        Some(value) => value.numbers().map_err(|e| format!("{name}: {e}")),
        None => Err(format!("no {name}; it has the keys {}", some_of(node.keys(), 8))),
    };
    if word("camera_model") != "pinhole" {
        return Err(format!("camera_model is {}: only pinhole is read", quoted(word("camera_model"))));
    }
    let lens = match word("distortion_model") {
        "radtan" => brown_conrady(&numbers("distortion_coeffs")?)?,
        "none" | "" => Lens::None,
        model if is_fisheye(model) => kannala_brandt(&numbers("distortion_coeffs")?)?,
        other => {
            return Err(format!("distortion_model is {}: only radtan, equidistant and none are read", plain(other)));
        }
    };
    let intrinsics = numbers("intrinsics")?;
    let [fx, fy, cx, cy] = intrinsics[..] else {
        return Err(format!("intrinsics: expected fx, fy, cx, cy, found {} numbers", intrinsics.len()));
    };
    let resolution = numbers("resolution")?;
    let [w, h] = resolution[..] else {
        return Err(format!("resolution: expected width and height, found {} numbers", resolution.len()));
    };
    ImportedCamera::new("Kalibr", Some([w, h]), Intrinsics { fx, fy, cx, cy, skew: 0.0 }, lens)
}
