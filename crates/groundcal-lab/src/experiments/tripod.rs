//! The first experiment: a tripod moved over the floor, 14 motions of varied roll.

use groundcal::start::Constraint;

use crate::{
    error::LabError,
    experiments::{
        methods,
        setup::{Description, ExperimentOutput, Setup, motions, pairs_of},
        subsets,
    },
};

/// The experiment.
pub(crate) const DESCRIPTION: Description = Description {
    name: "tripod",
    scene: include_str!("../../scenes/tripod.toml"),
    paper: "focal length 0.8 % off with `focal`; the best triple of motions 0.1 %",
};

/// Renders, calibrates and sums up.
pub(crate) fn run(setup: &Setup) -> Result<ExperimentOutput, LabError> {
    use Constraint::*;
    let pictures = setup.pictures(&pairs_of(&setup.scene), 7)?;
    let lines = setup.lines(&pictures, &[Full, ZeroSkew, Square, FixedPrincipalPoint, Focal, Auto])?;
    let measured = methods::measure(&pictures.matched, setup.frame(false), &setup.options(Focal, false))?;
    let minimal = [(Focal, 1), (Square, 2), (ZeroSkew, 2), (Full, 3)];
    let (mut files, of_subsets) = subsets::report(setup, &measured, &minimal)?;
    let (csv, table) = setup.table(&lines)?;
    files.splice(0..0, pictures.files.into_iter().chain([csv]));
    Ok(setup.output(&format!("{}{table}\n{of_subsets}", motions(&measured)), files))
}
