//! The second experiment: a pan head that stands still, 13 pans, the elevation alone varied.

use groundcal::start::Constraint;

use crate::{
    error::LabError,
    experiments::{
        methods,
        setup::{Description, ExperimentOutput, Setup, accept, motions, pairs_of},
        subsets,
        table::Line,
    },
};

/// The experiment.
pub(crate) const DESCRIPTION: Description = Description {
    name: "pan-head",
    scene: include_str!("../../scenes/pan-head.toml"),
    paper: "focal length about 10 % off; the rotating-camera method no better than 62 %",
};

/// Renders, calibrates and sums up.
pub(crate) fn run(setup: &Setup) -> Result<ExperimentOutput, LabError> {
    use Constraint::*;
    let pictures = setup.pictures(&pairs_of(&setup.scene), 7)?;
    let measured = methods::measure(&pictures.matched, setup.frame(false), &setup.options(Focal, false))?;
    let mut lines = setup.lines(&pictures, &[Full, ZeroSkew, Square, FixedPrincipalPoint, Focal, Auto])?;
    for constraint in [Full, ZeroSkew, Square, FixedPrincipalPoint, Focal] {
        let outcome = accept(methods::rotating(&measured, &setup.truth, constraint))?;
        let (input, method, motions) = ("features", "rotating camera", pictures.matched.len());
        lines.push(Line { input, constraint, told_centre: false, method, motions, outcome });
    }
    let minimal = [(Focal, 1), (FixedPrincipalPoint, 2), (Square, 2), (ZeroSkew, 3)];
    let (mut files, of_subsets) = subsets::report(setup, &measured, &minimal)?;
    let (csv, table) = setup.table(&lines)?;
    files.splice(0..0, pictures.files.into_iter().chain([csv]));
    Ok(setup.output(&format!("{}{table}\n{of_subsets}", motions(&measured)), files))
}
