//! `matches.csv`: image_a,image_b,xa,ya,xb,yb[,sigma_px].

use std::collections::HashMap;

use groundcal::{
    geometry::ImageSize,
    pairs::{ImagePair, PointMatch},
};

use crate::{
    error::IoError,
    limits::MAX_PAIRS,
    matches::{point_pairs::PointPairs, table::Table},
    text::plain,
};

/// All matches, by pair of images.
pub(crate) fn point_pairs(table: &Table, size: ImageSize) -> Result<PointPairs, IoError> {
    let mut names: Vec<String> = Vec::new();
    let mut index: HashMap<String, usize> = HashMap::new();
    let mut pairs: Vec<ImagePair> = Vec::new();
    let mut known: HashMap<(usize, usize), usize> = HashMap::new();
    table.each(|row| {
        let mut number_of = |name: String| {
            *index.entry(name).or_insert_with_key(|name| {
                names.push(name.clone());
                names.len() - 1
            })
        };
        let (from, to) = (number_of(row.name("image_a")?), number_of(row.name("image_b")?));
        if from == to {
            return Err(row.fault(format!("a match of {} with itself", plain(&names[from]))));
        }
        let a = row.point(["xa", "ya"], size)?;
        let b = row.point(["xb", "yb"], size)?;
        let mut m = PointMatch { sigma_px: row.sigma_px()?, ..PointMatch::new(a, b) };
        // The same two images the other way round belong to the same pair.
        let turned = known.contains_key(&(to, from));
        if turned {
            std::mem::swap(&mut m.a, &mut m.b);
        }
        let key = if turned { (to, from) } else { (from, to) };
        let at = *known.entry(key).or_insert_with(|| {
            pairs.push(ImagePair { from: key.0, to: key.1, matches: Vec::new() });
            pairs.len() - 1
        });
        pairs[at].matches.push(m);
        if pairs.len() > MAX_PAIRS {
            return Err(row.fault(format!("more than {MAX_PAIRS} pairs of images. Give fewer at a time")));
        }
        Ok(())
    })?;
    Ok(PointPairs { names, pairs, neighbours_only: false, listed: None, notes: Vec::new() })
}
