//! What the program says of a scene: the only place that calls it. No options but those a family's user would give.

use std::panic::{AssertUnwindSafe, catch_unwind};

use groundcal::{
    Options, Silent, calibrate_images, calibrate_matches,
    geometry::ImageSize,
    result::{Calibration, ResidualReport},
};

use crate::lies::{kind::Medium, pictures::pictures, points::matches, scene::Scene};

/// The answer to a scene.
pub(crate) enum Outcome {
    /// There is one.
    Answered(Box<Answer>),
    /// There is none, and the program says why: short name, message.
    Refused(&'static str, String),
    /// It broke down.
    Crashed(String),
}

/// A camera with its error bars.
pub(crate) struct Answer {
    /// fx, fy, cx, cy.
    pub(crate) numbers: [f64; 4],
    /// Their standard deviations; `None`: held.
    pub(crate) sigmas: [Option<f64>; 4],
    /// Codes, each once for each time it was raised.
    pub(crate) warnings: Vec<String>,
    /// Pairs that take part as motions.
    pub(crate) used: Vec<String>,
    pub(crate) attitudes: usize,
    pub(crate) attitude_sigma_deg: f64,
    pub(crate) scene: &'static str,
    pub(crate) converged: Option<bool>,
    /// How much more the residuals of neighbours have in common than independent ones would; the largest of all kinds of points.
    pub(crate) design_effect: Option<f64>,
    /// Their variance over that of single homographies; the largest likewise.
    pub(crate) variance_factor: Option<f64>,
    /// What the program itself says of it: level, and codes of the reasons.
    pub(crate) level: String,
    pub(crate) reasons: Vec<String>,
    /// Priors that rule a number: posterior over prior deviation.
    pub(crate) priors: Vec<(String, f64)>,
}

/// Makes the matches or pictures of a scene and calibrates from them.
pub(crate) fn ask(scene: &Scene, medium: Medium) -> Outcome {
    let names = scene.names();
    let size = ImageSize::new(scene.size[0], scene.size[1]);
    let options = Options { pairs: scene.named.clone(), ..Options::default() };
    let result = match medium {
        Medium::Points => {
            let pairs = matches(scene);
            catch_unwind(AssertUnwindSafe(|| calibrate_matches(&names, size, &pairs, &options, &Silent)))
        }
        Medium::Pictures => {
            let images = pictures(scene);
            catch_unwind(AssertUnwindSafe(|| calibrate_images(&names, &images, &options, &Silent)))
        }
    };
    match result {
        Ok(Ok(calibration)) => Outcome::Answered(Box::new(answer(&calibration))),
        Ok(Err(error)) => Outcome::Refused(error.code(), error.to_string()),
        Err(payload) => {
            let text = payload.downcast_ref::<String>().cloned();
            Outcome::Crashed(text.or(payload.downcast_ref::<&str>().map(ToString::to_string)).unwrap_or_default())
        }
    }
}

fn answer(c: &Calibration) -> Answer {
    let (k, s) = (&c.camera, &c.standard_deviation);
    let largest = |of: &dyn Fn(&ResidualReport) -> f64| {
        let refinement = c.fit.refinement?;
        [refinement.patches, refinement.points].iter().flatten().map(of).reduce(f64::max)
    };
    Answer {
        numbers: [k.fx, k.fy, k.cx, k.cy],
        sigmas: [s.fx, s.fy, s.cx, s.cy],
        warnings: c.warnings.iter().map(|w| w.code().to_string()).collect(),
        used: c.motions.iter().filter(|m| m.used).map(|m| format!("{}-{}", m.from, m.to)).collect(),
        attitudes: c.attitudes.len(),
        attitude_sigma_deg: c.attitude_sigma_deg,
        scene: match c.scene {
            Some(groundcal::result::Scene::Floor) => "floor",
            Some(groundcal::result::Scene::Directions) => "directions",
            None => "linear",
        },
        converged: c.fit.refinement.map(|r| r.converged),
        design_effect: largest(&|r| r.design_effect),
        variance_factor: largest(&|r| r.variance_factor),
        level: c.verdict.as_ref().map_or(String::new(), |v| v.level.to_string()),
        reasons: c.verdict.iter().flat_map(|v| &v.reasons).map(|r| r.code.clone()).collect(),
        priors: c.priors.iter().map(|p| (p.parameter.to_string(), p.posterior_over_prior)).collect(),
    }
}
