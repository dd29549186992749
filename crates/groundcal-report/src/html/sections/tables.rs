//! Plain tables: views, pairs, covariance.

use groundcal::result::{Calibration, Parameter};

use crate::{
    html::markup::{NONE, fixed, table, with_sigma},
    number::typeset,
};

/// Pairs listed one by one; the rest is counted.
const LISTED: usize = 400;

pub(crate) fn section(c: &Calibration) -> String {
    let mut out = String::new();
    if !c.views.is_empty() {
        out.push_str(&views(c));
    }
    out.push_str(&pairs(c));
    out.push_str(&covariance(c));
    out
}

fn views(c: &Calibration) -> String {
    let rows: Vec<Vec<String>> = c
        .views
        .iter()
        .map(|v| {
            let coordinate =
                |i: usize| v.position.map_or(NONE.into(), |p| with_sigma(p[i], v.position_sigma.map(|s| s[i])));
            let number = c.evidence.images.iter().position(|n| *n == v.image);
            vec![
                number.map_or_else(|| NONE.into(), |i| (i + 1).to_string()),
                v.image.clone(),
                v.origin.clone(),
                with_sigma(v.yaw_deg, Some(v.yaw_sigma_deg)),
                fixed(v.pitch_down_deg, 3),
                fixed(v.roll_deg, 3),
                coordinate(0),
                coordinate(1),
                coordinate(2),
                v.observations.to_string(),
            ]
        })
        .collect();
    table(
        "Views: position and heading over the floor, below the origin's camera, +X along its heading, Z up, unit its height",
        &["no.", "image", "origin", "heading, deg", "pitch down, deg", "roll, deg", "x", "y", "height", "points"],
        &rows,
    )
}

fn pairs(c: &Calibration) -> String {
    let number = |v: Option<f64>, sigma: Option<f64>| v.map_or(NONE.into(), |v| with_sigma(v, sigma));
    let mut order: Vec<usize> = (0..c.motions.len()).collect();
    order.sort_by_key(|&i| {
        (!c.motions[i].used, !c.motions[i].cross_attitude_link, c.motions[i].rotation_deg.is_none(), i)
    });
    let rows: Vec<Vec<String>> = order
        .iter()
        .take(LISTED)
        .map(|&i| {
            let m = &c.motions[i];
            let role = if m.used {
                "motion"
            } else if m.cross_attitude_link {
                "link"
            } else {
                "not used"
            };
            vec![
                format!("{} \u{2192} {}", m.from, m.to),
                role.into(),
                number(m.rotation_deg, m.rotation_sigma_deg),
                number(m.height_ratio, m.height_ratio_sigma),
                format!("{} of {}", m.matches, m.candidate_matches),
                m.rms_px.map_or(NONE.into(), |v| fixed(v, 3)),
                m.reason.clone().unwrap_or_default(),
            ]
        })
        .collect();
    let mut out = table(
        "Pairs of images (turn: of the camera, anticlockwise seen from above; height ratio: height of the second view over that of the first)",
        &["pair", "part", "turn, deg", "height ratio", "matches", "rms, px", "why not"],
        &rows,
    );
    out = format!("<div id=\"pairs\">{out}</div>\n");
    if c.motions.len() > LISTED {
        out.push_str(&format!(
            "<p>{LISTED} of {} pairs are listed; all are in calibration.json.</p>\n",
            c.motions.len()
        ));
    }
    out
}

fn covariance(c: &Calibration) -> String {
    let free: Vec<Parameter> = Parameter::ALL.into_iter().filter(|p| c.covariance.get(*p, *p) > 0.0).collect();
    let heads: Vec<&str> = [""].into_iter().chain(free.iter().map(|p| p.name())).collect();
    let rows: Vec<Vec<String>> = free
        .iter()
        .map(|r| {
            let values = free.iter().map(|k| typeset(&format!("{:.3e}", c.covariance.get(*r, *k))));
            [r.to_string()].into_iter().chain(values).collect()
        })
        .collect();
    table("Covariance of the camera's numbers (pixels squared; those of the lens without unit)", &heads, &rows)
}
