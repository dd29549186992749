//! The sections of the page, each a figure or table with a sentence on how to read it.

mod attitudes;
mod camera;
mod copy;
mod floor;
mod images;
mod motions;
mod projection;
mod residuals;
mod tables;

use groundcal::result::{Calibration, Method, MotionKind, Scene, level_with};

use crate::{
    canvas::svg::escape,
    html::{
        markup::{counted, fixed},
        model::Model,
        pictures::Pictures,
    },
    number::decimals_of_sigma,
    text::{beside_warnings, verdict_line},
    uncertainty::in_short,
};

/// The page's title.
pub(crate) fn title(c: &Calibration) -> String {
    format!("Camera, fx = {} px, from {} images", fixed(c.camera.fx, 1), c.evidence.images.len())
}

/// Everything between `<body>` and the scripts.
pub(crate) fn body(c: &Calibration, model: &Model, pictures: &Pictures, command: Option<&str>) -> String {
    let mut page = String::with_capacity(4 << 20);
    let mut sections: Vec<(&str, &str, String)> = vec![
        ("warnings", "Warnings", warnings(model)),
        ("camera", "Camera", camera::section(c, model)),
        ("images", "Images", images::section(c, pictures)),
    ];
    if let Some(of) = &c.projection_uncertainty {
        sections.push(("projection", "Expected error", projection::section(c, of)));
    }
    sections.push(("motions", "Motions", motions::section(model, c, pictures)));
    if let Some(residuals) = &model.residuals {
        sections.push(("residuals", "Residuals", residuals::section(c, residuals)));
    }
    if !model.floor.is_empty() {
        sections.push(("floor", "Views over the floor", floor::section(model)));
    }
    sections.push(("tables", "All numbers", tables::section(c)));
    if let Some(conic) = &model.conic {
        sections.push(("attitudes", "Appendix: attitudes and the absolute conic", attitudes::section(c, conic)));
    }
    page.push_str("<a class=\"skip\" href=\"#main\">Skip to the content</a>\n<header>\n");
    page.push_str(&headline(c, model));
    page.push_str("<nav aria-label=\"Sections\"><ul>");
    for (id, name, _) in &sections {
        page.push_str(&format!("<li><a href=\"#{id}\">{name}</a></li>"));
    }
    page.push_str("</ul></nav>\n</header>\n");
    page.push_str(&motions::definitions(pictures));
    page.push_str("<main id=\"main\">\n");
    for (id, name, content) in &sections {
        page.push_str(&format!(
            "<section id=\"{id}\" aria-labelledby=\"h-{id}\">\n<h2 id=\"h-{id}\">{name}</h2>\n{content}</section>\n"
        ));
    }
    page.push_str(&format!("</main>\n{}", footer(c, command)));
    page
}

fn headline(c: &Calibration, model: &Model) -> String {
    let sigma = c.standard_deviation.fx;
    let f = match sigma {
        Some(s) => format!(
            "fx = {} \u{b1} {} px ({} %)",
            fixed(c.camera.fx, decimals_of_sigma(s)),
            fixed(s, decimals_of_sigma(s)),
            fixed(100.0 * s / c.camera.fx, 3)
        ),
        None => format!("fx = {} px, held", fixed(c.camera.fx, 2)),
    };
    let used = c.motions.iter().filter(|m| m.used).count();
    let [w, h] = c.camera.image_size;
    let warned = match model.warnings.len() {
        0 => "no warnings".to_string(),
        n => format!("<a href=\"#warnings\">{}</a>", counted(n, "warning")),
    };
    format!(
        "<h1>Camera calibration</h1>\n{}<p class=\"lead\"><strong>{f}</strong></p>\n{}{}\
         <p>{} of {w} \u{d7} {h} px, {used} of {} pairs used as {}; constraint {}, {}; {warned}.</p>\n",
        verdict(c),
        errors(c),
        copy::block(c),
        counted(c.evidence.images.len(), "image"),
        c.motions.len(),
        match c.motion {
            Some(MotionKind::General) => "views of one plane, each with an attitude of its own".to_string(),
            _ => format!("motions, {}", counted(c.attitudes.len(), "attitude")),
        },
        escape(&c.constraint.to_string()),
        match c.method {
            Method::Joint => "joint refinement",
            Method::Linear => "linear method, weighted and polished",
            Method::Kzr => "linear method as published",
            Method::Transferred => "linear method, one motion transferred",
            Method::Rotating => "rotating-camera method",
        },
    )
}

/// What users of other programs look for first, and what they should.
fn errors(c: &Calibration) -> String {
    let mut said = Vec::new();
    if let Some((rms_px, r)) = c.fit.refinement.as_ref().and_then(|r| Some((r.reprojection_rms_px?, r))) {
        said.push(format!(
            "Reprojection error <strong>{} px</strong> rms over {} observations of {} points",
            fixed(rms_px, decimals_of_sigma(rms_px).min(4)),
            r.observations,
            r.tracks
        ));
    }
    let grid = c.projection_uncertainty.as_ref();
    if let Some([middle, _, most]) = grid.and_then(|g| in_short(g, &g.distant_px)) {
        let [middle, most] = [middle, most].map(|v| fixed(v, decimals_of_sigma(v).min(4)));
        said.push(format!(
            "points far away are shown to within <a href=\"#projection\"><strong>{middle} px</strong> in the middle of the image, {most} px at worst</a>"
        ));
    }
    if said.is_empty() { String::new() } else { format!("<p>{}.</p>\n", said.join("; ")) }
}

/// How the page came about.
fn footer(c: &Calibration, command: Option<&str>) -> String {
    let unit = match (c.scene, c.camera_height_m) {
        (Some(Scene::Directions), _) => "",
        (_, Some(_)) => " Lengths on the floor are in metres.",
        (_, None) => " Lengths on the floor are in heights of the camera named.",
    };
    let by = command.map_or(String::new(), |c| format!("<p>Made by <code id=\"command\">{}</code></p>", escape(c)));
    format!(
        "<footer>{by}<p>groundcal {}, calibration.json of schema {}. Pixel (0, 0) is the centre of the top-left pixel.{unit}</p></footer>\n",
        env!("CARGO_PKG_VERSION"),
        c.schema_version
    )
}

/// Whether to trust it; reasons that are warnings stand in full below.
fn verdict(c: &Calibration) -> String {
    let Some(v) = &c.verdict else { return String::new() };
    let own: String = beside_warnings(c).iter().map(|r| format!("<br>{}.", escape(&sentence(&r.message)))).collect();
    format!("<p class=\"verdict {}\"><strong>{}.</strong>{own}</p>\n", v.level, escape(&verdict_line(v)))
}

/// With a capital at its beginning.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

fn warnings(model: &Model) -> String {
    if model.warnings.is_empty() {
        return "<p>None.</p>\n".into();
    }
    // The gravest first, the others in the order in which they were found.
    let mut sorted: Vec<_> = model.warnings.iter().collect();
    sorted.sort_by_key(|w| std::cmp::Reverse(level_with(&w.warning)));
    let items: String = sorted
        .iter()
        .map(|w| format!("<li><strong><code>{}</code></strong> {}.</li>\n", w.warning.code(), escape(&w.message)))
        .collect();
    format!("<ul class=\"warnings\">\n{items}</ul>\n")
}
