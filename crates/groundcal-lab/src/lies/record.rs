//! What is written down of each scene, and its forms: JSON lines, CSV. Neither holds a time, so that two runs can be compared byte by byte.

use serde::{Deserialize, Serialize};

use crate::lies::{
    front_door::{Answer, Outcome},
    kind::{Kind, Medium},
    scene::Scene,
};

/// From so many stated standard deviations on an answer is a lie.
pub const LIE_SIGMAS: f64 = 4.0;
/// From here on it counts as wrong.
pub(crate) const WRONG_SIGMAS: f64 = 3.0;
/// Errors in deviations are not told beyond this.
const MAX_SIGMAS: f64 = 1e6;
const NUMBERS: [&str; 4] = ["fx", "fy", "cx", "cy"];

/// What the program did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Answered within [`LIE_SIGMAS`].
    Answered,
    /// Answered, and further off.
    Lied,
    /// Gave no answer and said why.
    Refused,
    /// Panicked.
    Crashed,
}

/// One scene and the answer to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneRecord {
    /// Name of the family.
    pub family: String,
    /// Number of the scene in the family.
    pub index: usize,
    /// Seed of the run.
    pub seed: u64,
    /// How the family stands to what is assumed.
    pub kind: Kind,
    /// What the program was given.
    pub medium: Medium,
    /// What it did.
    pub verdict: Verdict,
    /// Short name of the error where it refused, and the message.
    pub error: Option<[String; 2]>,
    /// The right answer (the nearest of several): fx, fy, cx, cy.
    pub truth: [f64; 4],
    /// The program's.
    pub answer: Option<[f64; 4]>,
    /// Its standard deviations; null: held.
    pub sigma: [Option<f64>; 4],
    /// Error over standard deviation; null: held, or no answer.
    pub error_sigmas: [Option<f64>; 4],
    /// Codes of the warnings, each as often as raised.
    pub warnings: Vec<String>,
    /// Pairs that took part as motions.
    pub used: Vec<String>,
    /// Attitudes among them.
    pub attitudes: usize,
    /// Deviation of the views' attitudes that was allowed for, degrees.
    pub attitude_sigma_deg: f64,
    /// What the points were taken for.
    pub scene: String,
    /// Whether the refinement ended by itself; null: there was none.
    pub converged: Option<bool>,
    /// How much more the residuals of neighbouring points have in common than independent ones would.
    #[serde(default)]
    pub design_effect: Option<f64>,
    /// Variance of the residuals over that under single homographies.
    #[serde(default)]
    pub variance_factor: Option<f64>,
    /// How far the program says that the answer can be trusted; empty: no answer.
    #[serde(default)]
    pub level: String,
    /// Why no further.
    #[serde(default)]
    pub reasons: Vec<String>,
    /// Posterior over prior deviation of what has a prior.
    pub priors: Vec<(String, f64)>,
}

impl SceneRecord {
    /// The record of an outcome.
    pub(crate) fn new(family: (&str, Kind, Medium), (seed, index): (u64, usize), scene: &Scene, out: Outcome) -> Self {
        let (name, kind, medium) = family;
        let mut record = Self {
            family: name.to_string(),
            index,
            seed,
            kind,
            medium,
            verdict: Verdict::Crashed,
            error: None,
            truth: scene.truths.first().copied().unwrap_or([f64::NAN; 4]),
            answer: None,
            sigma: [None; 4],
            error_sigmas: [None; 4],
            warnings: Vec::new(),
            used: Vec::new(),
            attitudes: 0,
            attitude_sigma_deg: 0.0,
            scene: String::new(),
            converged: None,
            design_effect: None,
            variance_factor: None,
            level: String::new(),
            reasons: Vec::new(),
            priors: Vec::new(),
        };
        match out {
            Outcome::Crashed(message) => record.error = Some(["panic".into(), message]),
            Outcome::Refused(name, message) => {
                record.verdict = Verdict::Refused;
                record.error = Some([name.into(), message.chars().take(240).collect()]);
            }
            Outcome::Answered(answer) => record.take(&answer, &scene.truths),
        }
        record
    }

    fn take(&mut self, answer: &Answer, truths: &[[f64; 4]]) {
        let errors = |truth: &[f64; 4]| -> [Option<f64>; 4] {
            std::array::from_fn(|i| {
                let z = (answer.numbers[i] - truth[i]) / answer.sigmas[i]?;
                Some(if z.is_nan() { MAX_SIGMAS } else { z.clamp(-MAX_SIGMAS, MAX_SIGMAS) })
            })
        };
        let nearest = truths.iter().min_by(|a, b| largest(&errors(a)).total_cmp(&largest(&errors(b))));
        if let Some(truth) = nearest {
            (self.truth, self.error_sigmas) = (*truth, errors(truth));
        }
        self.verdict = if self.worst_sigmas() > LIE_SIGMAS { Verdict::Lied } else { Verdict::Answered };
        (self.answer, self.sigma) = (Some(answer.numbers), answer.sigmas);
        self.warnings = answer.warnings.iter().map(ToString::to_string).collect();
        self.used.clone_from(&answer.used);
        self.attitudes = answer.attitudes;
        self.attitude_sigma_deg = answer.attitude_sigma_deg;
        self.scene = answer.scene.to_string();
        self.converged = answer.converged;
        (self.design_effect, self.variance_factor) = (answer.design_effect, answer.variance_factor);
        self.level = answer.level.clone();
        self.reasons.clone_from(&answer.reasons);
        self.priors = answer.priors.clone();
    }

    /// The largest of the errors in deviations.
    pub fn worst_sigmas(&self) -> f64 {
        largest(&self.error_sigmas)
    }

    /// Relative error of fx in per cent.
    pub fn focal_error_percent(&self) -> Option<f64> {
        Some(100.0 * (self.answer?[0] / self.truth[0] - 1.0))
    }

    /// Relative standard deviation of fx in per cent.
    pub fn focal_sigma_percent(&self) -> Option<f64> {
        Some(100.0 * self.sigma[0]? / self.answer?[0])
    }

    /// Whether there is an answer, right or wrong.
    pub fn is_answer(&self) -> bool {
        self.answer.is_some()
    }
}

fn largest(errors: &[Option<f64>; 4]) -> f64 {
    errors.iter().flatten().fold(0.0, |most: f64, z| most.max(z.abs()))
}

/// One record a line.
///
/// # Errors
/// When a record cannot be written, which does not happen.
pub fn to_json_lines(records: &[SceneRecord]) -> Result<String, serde_json::Error> {
    let lines: Vec<String> = records.iter().map(serde_json::to_string).collect::<Result<_, _>>()?;
    Ok(lines.join("\n") + "\n")
}

/// The records of a file of JSON lines.
///
/// # Errors
/// When a line is not a record.
pub fn read_json_lines(text: &str) -> Result<Vec<SceneRecord>, serde_json::Error> {
    text.lines().filter(|l| !l.trim().is_empty()).map(serde_json::from_str).collect()
}

/// One record a line, with a heading.
pub fn csv(records: &[SceneRecord]) -> String {
    let mut out = String::from("family,index,seed,kind,medium,verdict,error,worst_sigmas");
    for n in NUMBERS {
        out += &format!(",{n}_truth,{n},{n}_sigma,{n}_error_sigmas");
    }
    out += ",attitudes,attitude_sigma_deg,scene,converged,used,warnings\n";
    let number = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:.6}"));
    for r in records {
        let error = r.error.as_ref().map_or("", |e| e[0].as_str());
        let [kind, medium, verdict] =
            [format!("{:?}", r.kind), format!("{:?}", r.medium), format!("{:?}", r.verdict)].map(|s| s.to_lowercase());
        out +=
            &format!("{},{},{},{kind},{medium},{verdict},{error},{:.3}", r.family, r.index, r.seed, r.worst_sigmas());
        for i in 0..4 {
            let answer = number(r.answer.map(|a| a[i]));
            out += &format!(",{:.6},{answer},{},{}", r.truth[i], number(r.sigma[i]), number(r.error_sigmas[i]));
        }
        let converged = r.converged.map_or("", |c| if c { "yes" } else { "no" });
        out += &format!(
            ",{},{:.5},{},{converged},{},{}\n",
            r.attitudes,
            r.attitude_sigma_deg,
            r.scene,
            r.used.join(" "),
            r.warnings.join(" ")
        );
    }
    out
}
