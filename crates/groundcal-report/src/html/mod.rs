//! `report.html`: one page, everything inside, that shows a calibration and what it was made from.
//!
//! [`model`] computes the numbers, [`pictures`] the images, [`sections`] draw them, [`svg`] has the pieces.

mod model;
mod pictures;
mod sections;
mod svg;

use std::fmt::Write;

use groundcal::{remedy::Wording, result::Calibration, vision::image::GrayImage};

use crate::error::ReportError;
use pictures::Pictures;
use svg::escape;

/// The page. `images` in the order of the calibration's evidence; none for matches from elsewhere.
pub fn html(c: &Calibration, images: &[GrayImage], wording: &dyn Wording) -> Result<String, ReportError> {
    let mut model = model::model(c, wording);
    let pictures = if images.is_empty() {
        Pictures::default()
    } else {
        pictures::pictures(images, &c.evidence, &mut model.motions)?
    };
    let data = serde_json::to_string(&model)
        .map_err(|e| ReportError(format!("cannot write the numbers of the report: {e}")))?;
    let mut page = String::with_capacity(4 << 20);
    // Writing to a string cannot fail.
    let _ = write!(
        page,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n",
        escape(&sections::title(c)),
        include_str!("page.css"),
    );
    sections::write(&mut page, c, &model, &pictures);
    // No `</script>` may appear inside.
    let _ = write!(
        page,
        "<script type=\"application/json\" id=\"groundcal-data\">{}</script>\n<script>\n{}</script>\n</body>\n</html>\n",
        data.replace('<', "\\u003c"),
        include_str!("page.js"),
    );
    Ok(page)
}
