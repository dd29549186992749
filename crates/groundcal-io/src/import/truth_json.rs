//! truth.json of a rendered scene (docs/formats.md).

use groundcal::geometry::{Intrinsics, Lens};

use crate::{
    import::{imported::ImportedCamera, node::Node},
    text::plain,
};

/// The camera; it has no errors.
pub(crate) fn cameras(root: &Node) -> Result<Vec<ImportedCamera>, String> {
    let number = |node: &Node, path: &str, name: &str| match node.get(&[name]) {
        None => Ok(None),
        Some(Node::Number(v)) => Ok(Some(*v)),
        Some(_) => Err(format!("{path}{name} is not a number")),
    };
    let required = |name: &str| number(root, "", name)?.ok_or_else(|| format!("not a truth.json: no {name}"));
    let size = root.get(&["image_size"]).map(Node::numbers).transpose().map_err(|e| format!("image_size: {e}"))?;
    let Some([w, h]) = size.as_deref() else {
        return Err("image_size: expected width and height".into());
    };
    let intrinsics = Intrinsics {
        fx: required("fx")?,
        fy: required("fy")?,
        cx: required("cx")?,
        cy: required("cy")?,
        skew: number(root, "", "skew")?.unwrap_or(0.0),
    };
    let lens = match root.get(&["distortion"]) {
        Some(lens @ Node::Map(_)) => {
            let model = match lens.get(&["model"]) {
                None => "radtan",
                Some(model) => model.text().ok_or("distortion.model is not a word")?,
            };
            let mut given = Vec::new();
            for name in ["k1", "k2", "p1", "p2", "k3", "k4", "lambda"] {
                given.extend(number(lens, "distortion.", name)?.map(|value| (name, value)));
            }
            Lens::from_named(&plain(model), given)?
        }
        Some(Node::Text(nothing)) if nothing.is_empty() => Lens::None,
        Some(_) => return Err("distortion is not an object of coefficients".into()),
        None => Lens::None,
    };
    Ok(vec![ImportedCamera::new("truth", Some([*w, *h]), intrinsics, lens)?])
}
