//! `report.html`: one page, everything inside, that shows a calibration and what it was made from.
//!
//! `model` computes the numbers, `pictures` the images, `sections` draw them.

mod markup;
mod model;
mod pictures;
mod sections;

use groundcal::{Wording, result::Calibration, vision::GrayImage};

use crate::{canvas::svg::escape, error::ReportError};
use pictures::Pictures;

/// The page. `images` in the order of the calibration's evidence; none for matches from elsewhere. `command`: what made it, in a line.
///
/// # Errors
/// An image without pixels; a fault in encoding a picture.
pub fn page(
    c: &Calibration,
    images: &[GrayImage],
    wording: &dyn Wording,
    command: Option<&str>,
) -> Result<String, ReportError> {
    let mut model = model::model(c, wording);
    let pictures = if images.is_empty() {
        Pictures::default()
    } else {
        pictures::pictures(images, &c.evidence, &mut model.motions)?
    };
    let data = serde_json::to_string(&model)
        .map_err(|e| ReportError(format!("cannot write the numbers of the report: {e}")))?;
    let (title, style, script) = (escape(&sections::title(c)), include_str!("page.css"), include_str!("page.js"));
    let body = sections::body(c, &model, &pictures, command);
    // No `</script>` may appear inside.
    let data = data.replace('<', "\\u003c");
    Ok(format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}\
         <script type=\"application/json\" id=\"groundcal-data\">{data}</script>\n<script>\n{script}</script>\n</body>\n</html>\n"
    ))
}
