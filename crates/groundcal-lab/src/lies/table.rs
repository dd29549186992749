//! The table of a run: a line a family, the totals, what was warned of right and wrong answers.

use std::collections::{BTreeMap, BTreeSet};

use groundcal::numerics::median;

use crate::lies::{
    kind::Kind,
    record::{LIE_SIGMAS, SceneRecord, Verdict, WRONG_SIGMAS},
};

/// Design effect that residuals without a pattern do not reach.
const PATTERNED: f64 = 2.6;

/// Counts over records.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Totals {
    /// Scenes.
    pub scenes: usize,
    /// Those with an answer.
    pub answered: usize,
    /// Those without.
    pub refused: usize,
    /// Panics.
    pub crashed: usize,
    /// Answers beyond three deviations.
    pub wrong: usize,
    /// Answers beyond four.
    pub lies: usize,
    /// Intervals of 95 % that hold the truth, and all intervals.
    pub held: [usize; 2],
}

/// The counts.
pub fn totals<'a>(records: impl IntoIterator<Item = &'a SceneRecord>) -> Totals {
    let mut t = Totals::default();
    for r in records {
        t.scenes += 1;
        match r.verdict {
            Verdict::Refused => t.refused += 1,
            Verdict::Crashed => t.crashed += 1,
            Verdict::Answered | Verdict::Lied => t.answered += 1,
        }
        t.wrong += usize::from(r.worst_sigmas() > WRONG_SIGMAS);
        t.lies += usize::from(r.worst_sigmas() > LIE_SIGMAS);
        let within = r.error_sigmas.iter().flatten();
        t.held[1] += within.clone().count();
        t.held[0] += within.filter(|z| z.abs() < 1.96).count();
    }
    t
}

/// The median, where there is one.
fn middle(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| median(&mut values))
}

/// `code 3, code` for codes and how many scenes have them.
fn warning_counts<'a>(records: impl Iterator<Item = &'a SceneRecord>) -> BTreeMap<&'a str, usize> {
    let mut counts = BTreeMap::new();
    for r in records {
        let codes: BTreeSet<&str> = r.warnings.iter().map(String::as_str).collect();
        for code in codes {
            *counts.entry(code).or_insert(0) += 1;
        }
    }
    counts
}

fn groups(records: &[SceneRecord]) -> BTreeMap<&str, Vec<&SceneRecord>> {
    let mut all: BTreeMap<&str, Vec<&SceneRecord>> = BTreeMap::new();
    for r in records {
        all.entry(&r.family).or_default().push(r);
    }
    all
}

/// The table as text, families that lie most first.
pub fn table(records: &[SceneRecord]) -> String {
    let mut families: Vec<(&str, Vec<&SceneRecord>, Totals)> = groups(records)
        .into_iter()
        .map(|(name, of)| {
            let t = totals(of.iter().copied());
            (name, of, t)
        })
        .collect();
    let share = |t: &Totals| t.lies as f64 / t.scenes.max(1) as f64;
    families.sort_by(|a, b| share(&b.2).total_cmp(&share(&a.2)).then(a.0.cmp(b.0)));
    let mut out = format!(
        "{:<34} {:<14} {:>6} {:>8} {:>7} {:>5} {:>5} {:>9} {:>9} {:>8}  worst\n",
        "family", "kind", "scenes", "answered", "refused", "lies", ">3 sd", "|err f| %", "sd f %", "held 95%"
    );
    let percent = |v: Option<f64>| v.map_or("-".to_string(), |v| format!("{v:.3}"));
    for (name, of, t) in &families {
        let error = middle(of.iter().filter_map(|r| Some(r.focal_error_percent()?.abs())));
        let sigma = middle(of.iter().filter_map(|r| r.focal_sigma_percent()));
        let worst = of.iter().filter(|r| r.is_answer()).max_by(|a, b| a.worst_sigmas().total_cmp(&b.worst_sigmas()));
        let worst = worst.map_or(String::new(), |r| format!("{:.1} sd (scene {})", r.worst_sigmas(), r.index));
        let held =
            if t.held[1] == 0 { "-".into() } else { format!("{:.0}", 100.0 * t.held[0] as f64 / t.held[1] as f64) };
        out += &format!(
            "{name:<34} {:<14} {:>6} {:>8} {:>7} {:>5} {:>5} {:>9} {:>9} {held:>8}  {worst}{}\n",
            of[0].kind.name(),
            t.scenes,
            t.answered,
            t.refused,
            t.lies,
            t.wrong,
            percent(error),
            percent(sigma),
            if t.crashed > 0 { format!("  {} CRASHED", t.crashed) } else { String::new() }
        );
    }
    out += &summary(records);
    out
}

fn summary(records: &[SceneRecord]) -> String {
    let mut out = String::from("\n");
    let mut line = |label: &str, of: Vec<&SceneRecord>| {
        let t = totals(of.iter().copied());
        if t.scenes == 0 {
            return;
        }
        let thousand = 1000.0 * t.lies as f64 / t.scenes as f64;
        let held = 100.0 * t.held[0] as f64 / t.held[1].max(1) as f64;
        out += &format!(
            "{label:<34} {:>6} scenes: {} answered, {} refused, {} crashed; {} lies ({thousand:.1} of 1,000), {} beyond 3 sd; 95 % \
             intervals hold {held:.1} %\n",
            t.scenes, t.answered, t.refused, t.crashed, t.lies, t.wrong
        );
    };
    for kind in [Kind::Violated, Kind::Degenerate, Kind::General, Kind::WellSpecified] {
        line(kind.name(), records.iter().filter(|r| r.kind == kind).collect());
    }
    line("all but well-specified", records.iter().filter(|r| r.kind != Kind::WellSpecified).collect());
    out += "\nwarnings, in scenes                 right answers   3 to 4 sd   lies\n";
    let of = |low: f64, high: f64| {
        warning_counts(records.iter().filter(move |r| r.is_answer() && (low..high).contains(&r.worst_sigmas())))
    };
    let bands = [of(-1.0, WRONG_SIGMAS), of(WRONG_SIGMAS, LIE_SIGMAS), of(LIE_SIGMAS, f64::INFINITY)];
    let codes: BTreeSet<&str> = bands.iter().flat_map(|b| b.keys().copied()).collect();
    for code in codes {
        let [right, near, lies] = bands.each_ref().map(|b| b.get(code).copied().unwrap_or(0));
        out += &format!("{code:<34} {right:>14} {near:>11} {lies:>6}\n");
    }
    out += "\nverdicts                            right answers   3 to 4 sd   lies\n";
    for level in ["trustworthy", "usable", "unchecked"] {
        let count = |low: f64, high: f64| {
            let of = |r: &&SceneRecord| r.is_answer() && r.level == level && (low..high).contains(&r.worst_sigmas());
            records.iter().filter(of).count()
        };
        let [right, near, lies] =
            [count(-1.0, WRONG_SIGMAS), count(WRONG_SIGMAS, LIE_SIGMAS), count(LIE_SIGMAS, f64::INFINITY)];
        out += &format!("{level:<34} {right:>14} {near:>11} {lies:>6}\n");
    }
    let silent = records.iter().filter(|r| r.verdict == Verdict::Lied && r.warnings.is_empty()).count();
    let among = |lied: bool, which: &dyn Fn(&SceneRecord) -> bool| {
        records.iter().filter(|r| r.is_answer() && which(r) && (r.verdict == Verdict::Lied) == lied).count()
    };
    let unconverged = |r: &SceneRecord| r.converged == Some(false);
    let patterned = |r: &SceneRecord| r.design_effect.is_some_and(|d| d > PATTERNED);
    out += &format!("{silent} lies without any warning\n");
    for (what, which) in [
        ("refinement not converged", &unconverged as &dyn Fn(&SceneRecord) -> bool),
        ("design effect above 2.6", &patterned),
    ] {
        out += &format!("{what:<34} {:>14} {:>18}\n", among(false, which), among(true, which));
    }
    out
}

/// How often each warning, and each reason of a verdict, stands on an answer, as a table in Markdown: of well-specified scenes, of
/// right answers to the others, and of wrong ones (beyond three deviations). Those that tell wrong from right best come first.
pub fn warnings_table(well_specified: &[SceneRecord], others: &[SceneRecord]) -> String {
    let answers = |records: &'_ [SceneRecord], wrong: bool| {
        let of = |r: &&SceneRecord| r.is_answer() && (r.worst_sigmas() > WRONG_SIGMAS) == wrong;
        let codes = |r: &SceneRecord| r.warnings.iter().chain(&r.reasons).cloned().collect::<BTreeSet<String>>();
        records.iter().filter(of).map(codes).collect::<Vec<_>>()
    };
    let mut good = answers(well_specified, false);
    good.extend(answers(well_specified, true));
    let columns = [good, answers(others, false), answers(others, true)];
    let percent = |column: &[BTreeSet<String>], code: &str| {
        100.0 * column.iter().filter(|codes| codes.contains(code)).count() as f64 / column.len().max(1) as f64
    };
    let all: BTreeSet<&String> = columns.iter().flatten().flatten().collect();
    let mut rows: Vec<(&str, [f64; 3])> =
        all.iter().map(|code| (code.as_str(), columns.each_ref().map(|c| percent(c, code)))).collect();
    let tells = |[_, right, wrong]: &[f64; 3]| wrong / right.max(0.01);
    rows.sort_by(|a, b| tells(&b.1).total_cmp(&tells(&a.1)));
    let [good, right, wrong] = columns.each_ref().map(Vec::len);
    let mut out = format!(
        "| Code | of {good} answers to well-specified scenes | of {right} right answers to others | of {wrong} wrong ones |\n|---|---|---|---|\n"
    );
    for (code, [good, right, wrong]) in rows {
        out += &format!("| `{code}` | {good:.1} % | {right:.1} % | {wrong:.1} % |\n");
    }
    out
}
