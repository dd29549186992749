//! Two runs of the same scenes, by two versions of the program, scene by scene.

use std::collections::BTreeMap;

use crate::lies::{
    kind::Kind,
    record::{SceneRecord, Verdict},
};

fn key(r: &SceneRecord) -> (&str, u64, usize) {
    (&r.family, r.seed, r.index)
}

fn name(r: &SceneRecord) -> String {
    format!("{} {}", r.family, r.index)
}

fn described(r: &SceneRecord) -> String {
    match (&r.error, r.focal_error_percent()) {
        (Some([code, _]), _) => format!("{} ({code})", name(r)),
        (None, Some(error)) => format!(
            "{} ({:.1} sd, fx {error:+.2} % +- {:.2} %)",
            name(r),
            r.worst_sigmas(),
            r.focal_sigma_percent().unwrap_or(0.0)
        ),
        _ => name(r),
    }
}

/// What changed from `old` to `new`: new lies, new refusals, lies no more, new answers, and how the bars of fx compare where both are
/// right. Scenes that only one of them has are left out.
pub fn compare(old: &[SceneRecord], new: &[SceneRecord]) -> String {
    let before: BTreeMap<_, &SceneRecord> = old.iter().map(|r| (key(r), r)).collect();
    let both: Vec<(&SceneRecord, &SceneRecord)> = new.iter().filter_map(|n| Some((*before.get(&key(n))?, n))).collect();
    let mut out = format!("{} scenes in both runs\n", both.len());
    let mut list = |label: &str, which: &dyn Fn(&SceneRecord, &SceneRecord) -> bool| {
        let found: Vec<String> = both.iter().filter(|(o, n)| which(o, n)).map(|(_, n)| described(n)).collect();
        out += &format!("{label}: {}\n", found.len());
        for line in &found {
            out += &format!("    {line}\n");
        }
    };
    let lied = |r: &SceneRecord| r.verdict == Verdict::Lied;
    let right = |r: &SceneRecord| r.verdict == Verdict::Answered;
    list("newly lying", &|o, n| !lied(o) && lied(n));
    list("lying in both", &|o, n| lied(o) && lied(n));
    list("newly crashed", &|o, n| o.verdict != Verdict::Crashed && n.verdict == Verdict::Crashed);
    list("right before, refused now", &|o, n| right(o) && n.verdict == Verdict::Refused);
    list("lied before, right now", &|o, n| lied(o) && right(n));
    list("lied before, refused now", &|o, n| lied(o) && n.verdict == Verdict::Refused);
    list("refused before, right now", &|o, n| o.verdict == Verdict::Refused && right(n));
    let control = |r: &SceneRecord| r.kind == Kind::WellSpecified;
    let single = |r: &SceneRecord| r.attitudes <= 1;
    out += &bars("all others", both.iter().filter(|(o, _)| !control(o)));
    out += &bars("well-specified, several attitudes", both.iter().filter(|(o, _)| control(o) && !single(o)));
    out += &bars("well-specified, one attitude", both.iter().filter(|(o, _)| control(o) && single(o)));
    out
}

/// How many of the right answers stay, and the ratios of the bars of fx where they do.
fn bars<'a>(label: &str, pairs: impl Iterator<Item = &'a (&'a SceneRecord, &'a SceneRecord)>) -> String {
    let right = |r: &SceneRecord| r.verdict == Verdict::Answered;
    let before: Vec<_> = pairs.filter(|(o, _)| right(o)).collect();
    if before.is_empty() {
        return String::new();
    }
    let kept: Vec<_> = before.iter().filter(|(_, n)| right(n)).collect();
    let mut ratios: Vec<f64> =
        kept.iter().filter_map(|(o, n)| Some(n.focal_sigma_percent()? / o.focal_sigma_percent()?)).collect();
    ratios.sort_by(f64::total_cmp);
    let at = |q: f64| ratios.get(((ratios.len() as f64 - 1.0) * q).max(0.0) as usize).copied().unwrap_or(f64::NAN);
    format!(
        "{label}: {} of {} answered rightly before still are ({:.1} %); bars of fx, new over old: median {:.3}, 10 % below {:.3}, 90 % \
         below {:.3}\n",
        kept.len(),
        before.len(),
        100.0 * kept.len() as f64 / before.len() as f64,
        at(0.5),
        at(0.1),
        at(0.9)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lies::record::{read_json_lines, to_json_lines};

    fn record(index: usize, verdict: Verdict, sigma: f64) -> SceneRecord {
        let answered = matches!(verdict, Verdict::Answered | Verdict::Lied);
        SceneRecord {
            family: "a".into(),
            index,
            seed: 1,
            kind: Kind::Violated,
            medium: crate::lies::kind::Medium::Points,
            verdict,
            error: (verdict == Verdict::Refused).then(|| ["undetermined".into(), String::new()]),
            truth: [600.0, 600.0, 320.0, 240.0],
            answer: answered.then_some([606.0, 606.0, 320.0, 240.0]),
            sigma: [answered.then_some(sigma), None, None, None],
            error_sigmas: [answered.then_some(6.0 / sigma), None, None, None],
            warnings: Vec::new(),
            used: Vec::new(),
            attitudes: 1,
            attitude_sigma_deg: 0.1,
            scene: "floor".into(),
            converged: Some(true),
            design_effect: Some(1.0),
            level: String::new(),
            reasons: Vec::new(),
            variance_factor: None,
            priors: Vec::new(),
        }
    }

    #[test]
    fn changes_are_counted_and_records_survive_their_file() {
        let old = [
            record(0, Verdict::Answered, 3.0),
            record(1, Verdict::Lied, 1.0),
            record(2, Verdict::Answered, 3.0),
            record(3, Verdict::Refused, 1.0),
        ];
        let new = [
            record(0, Verdict::Answered, 4.5),
            record(1, Verdict::Refused, 1.0),
            record(2, Verdict::Lied, 0.5),
            record(3, Verdict::Answered, 3.0),
        ];
        assert_eq!(read_json_lines(&to_json_lines(&old).expect("text")).expect("records"), old);
        let text = compare(&old, &new);
        for line in [
            "newly lying: 1\n    a 2 (12.0 sd",
            "lied before, refused now: 1\n    a 1 (undetermined)",
            "refused before, right now: 1",
            "1 of 2 answered rightly before still are (50.0 %); bars of fx, new over old: median 1.500",
        ] {
            assert!(text.contains(line), "{line} in\n{text}");
        }
    }
}
