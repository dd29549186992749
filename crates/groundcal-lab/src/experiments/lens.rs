//! The tripod through a lens that bends, k1 = -0.2, and the paper's method after each way of correcting it first (KZR 3.2): pair by pair with
//! one parameter, minimised or in closed form, or with the lens that groundcal finds.

use groundcal::{
    Error, Method, MotionModel, Options, RadialCorrection, Silent, calibrate_matches, pairs::ImagePair,
    start::Constraint,
};

use crate::{
    error::LabError,
    experiments::{
        methods::{self, Scores},
        setup::{Description, ExperimentOutput, Pictures, Setup, accept, pairs_of},
        table::Line,
        tripod,
    },
};

/// The lens.
const K1: f64 = -0.2;

/// The experiment.
pub(crate) const DESCRIPTION: Description = Description {
    name: "lens",
    scene: tripod::DESCRIPTION.scene,
    paper: "radial distortion is corrected first, by one parameter; no figures of its own",
};

/// Renders, calibrates and sums up.
pub(crate) fn run(setup: &mut Setup) -> Result<ExperimentOutput, LabError> {
    for scene in [&mut setup.scene, &mut setup.full_scene] {
        scene.camera.k1 = K1;
    }
    let pictures = setup.pictures(&pairs_of(&setup.scene), 7)?;
    let mut lines = Vec::new();
    for (constraint, told_centre) in
        [(Constraint::ZeroSkew, false), (Constraint::Square, false), (Constraint::Focal, true)]
    {
        let motions = pictures.matched.len();
        let mut add = |input, method, outcome: Result<Scores, Error>| -> Result<(), LabError> {
            lines.push(Line { input, constraint, told_centre, method, motions, outcome: accept(outcome)? });
            Ok(())
        };
        let options = setup.options(constraint, told_centre);
        let ours = pictures.groundcal(&options, &setup.truth);
        let published = |radial, matched: &[ImagePair]| published(setup, &pictures, radial, matched, &options);
        add("features", "linear", published(RadialCorrection::None, &pictures.matched))?;
        add("features", "closed form", published(RadialCorrection::ClosedForm, &pictures.matched))?;
        add("features", "per pair", published(RadialCorrection::PerPair, &pictures.matched))?;
        if let Ok((_, c)) = &ours {
            add(
                "features",
                "undistorted",
                published(RadialCorrection::None, &methods::undistorted(&pictures.matched, c)),
            )?;
        }
        add("pictures", "groundcal", ours.map(|(scores, _)| scores))?;
    }
    let (csv, table) = setup.table(&lines)?;
    let files = pictures.files.into_iter().chain([csv]).collect();
    Ok(setup.output(&format!("k1 = {K1}\n{table}"), files))
}

/// The paper's method, told which pairs are motions.
fn published(
    setup: &Setup,
    pictures: &Pictures,
    radial: RadialCorrection,
    matched: &[ImagePair],
    options: &Options,
) -> Result<Scores, Error> {
    let options = Options {
        method: Method::Kzr,
        radial,
        pairs: Some(matched.iter().map(|p| (p.from, p.to)).collect()),
        motion: MotionModel::PlaneNormal,
        ..options.clone()
    };
    let c = calibrate_matches(pictures.names(), setup.scene.camera.size(), matched, &options, &Silent)?;
    Ok(Scores::of_calibration(&setup.truth, &c, options.constraint))
}
