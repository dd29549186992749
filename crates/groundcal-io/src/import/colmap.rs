//! COLMAP's cameras.txt: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]. COLMAP counts pixels from the corner of the image: its cx and cy less ½
//! are ours.

use groundcal::geometry::{Intrinsics, Lens};

use crate::{
    import::{
        imported::ImportedCamera,
        lens::{brown_conrady, kannala_brandt},
    },
    text::{plain, quoted},
};

fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(i, l)| (i + 1, l.trim())).filter(|(_, l)| !l.is_empty() && !l.starts_with('#'))
}

/// Whether the first line of data begins with a number, a word in capitals and a number.
pub(crate) fn looks_like_it(text: &str) -> bool {
    let Some((_, first)) = lines(text).next() else { return false };
    let words: Vec<&str> = first.split_whitespace().collect();
    let model = |w: &str| {
        w.contains(|c: char| c.is_ascii_uppercase())
            && w.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_')
    };
    words.len() >= 3 && words[0].parse::<u64>().is_ok() && model(words[1]) && words[2].parse::<u64>().is_ok()
}

/// All cameras of the file, named by their number.
pub(crate) fn cameras(text: &str) -> Result<Vec<ImportedCamera>, String> {
    lines(text).map(|(number, line)| camera(line).map_err(|e| format!("line {number}: {e}"))).collect()
}

fn camera(line: &str) -> Result<ImportedCamera, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [id, model, width, height, parameters @ ..] = &words[..] else {
        return Err(format!("expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS, found {} words", words.len()));
    };
    let number = |w: &&str| w.parse::<f64>().map_err(|_| format!("{} is not a number", quoted(w)));
    let values: Vec<f64> = parameters.iter().map(number).collect::<Result<_, String>>()?;
    let k = |fx: f64, fy: f64, cx: f64, cy: f64| Intrinsics { fx, fy, cx: cx - 0.5, cy: cy - 0.5, skew: 0.0 };
    let expected = |n: usize| Err(format!("{model} has {n} parameters, found {}", values.len()));
    let (intrinsics, lens) = match (*model, &values[..]) {
        ("SIMPLE_PINHOLE", [f, cx, cy]) => (k(*f, *f, *cx, *cy), Lens::None),
        ("PINHOLE", [fx, fy, cx, cy]) => (k(*fx, *fy, *cx, *cy), Lens::None),
        ("SIMPLE_RADIAL", [f, cx, cy, k1]) => (k(*f, *f, *cx, *cy), Lens::radial(*k1, 0.0)),
        ("RADIAL", [f, cx, cy, k1, k2]) => (k(*f, *f, *cx, *cy), Lens::radial(*k1, *k2)),
        ("OPENCV", [fx, fy, cx, cy, lens @ ..]) if lens.len() == 4 => (k(*fx, *fy, *cx, *cy), brown_conrady(lens)?),
        ("FULL_OPENCV", [fx, fy, cx, cy, lens @ ..]) if lens.len() == 8 => {
            (k(*fx, *fy, *cx, *cy), brown_conrady(lens)?)
        }
        ("SIMPLE_RADIAL_FISHEYE", [f, cx, cy, k1]) => (k(*f, *f, *cx, *cy), kannala_brandt(&[*k1, 0.0, 0.0, 0.0])?),
        ("RADIAL_FISHEYE", [f, cx, cy, k1, k2]) => (k(*f, *f, *cx, *cy), kannala_brandt(&[*k1, *k2, 0.0, 0.0])?),
        ("OPENCV_FISHEYE", [fx, fy, cx, cy, lens @ ..]) if lens.len() == 4 => {
            (k(*fx, *fy, *cx, *cy), kannala_brandt(lens)?)
        }
        ("SIMPLE_PINHOLE", _) => return expected(3),
        ("PINHOLE" | "SIMPLE_RADIAL" | "SIMPLE_RADIAL_FISHEYE", _) => return expected(4),
        ("RADIAL" | "RADIAL_FISHEYE", _) => return expected(5),
        ("OPENCV" | "OPENCV_FISHEYE", _) => return expected(8),
        ("FULL_OPENCV", _) => return expected(12),
        _ => {
            return Err(format!(
                "the camera model {} is not read: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV (with k4, \
                 k5, k6 zero), SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE and OPENCV_FISHEYE are",
                plain(model)
            ));
        }
    };
    let size = [number(width)?, number(height)?];
    ImportedCamera::new("COLMAP", Some(size), intrinsics, lens).map(|c| c.labelled(plain(id)))
}
