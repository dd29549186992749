//! A calibration without files, threads, clock or terminal: compiled for `wasm32-unknown-unknown` by `.ci/run`, which shows that the
//! library needs none of them.

#![forbid(unsafe_code)]

use groundcal::{
    Error,
    calibrate::{Options, Silent, calibrate_matches},
    plan::{Carrier, PlanOptions, Planner},
    synthetic::PointScene,
};

fn main() -> Result<(), Error> {
    let scene = PointScene::nominal(0);
    let mut names = Vec::new();
    let mut pairs = Vec::new();
    for motion in scene.pairs() {
        pairs.push(motion.pair);
        names.push(format!("view {}", names.len()));
        names.push(format!("view {}", names.len()));
    }
    let options = Options::default();
    let calibration = calibrate_matches(&names, scene.size, &pairs, &options, &Silent)?;
    let plan = PlanOptions {
        intrinsics: calibration.camera.intrinsics(),
        lens: Default::default(),
        size: scene.size,
        rig: Carrier::Tripod.motion(1.5).rig(),
        noise_px: 0.3,
        points: 300.0,
        motions: 1,
        calibration: options,
    };
    Planner::new(&plan, None)?.plan().map(|_| ())
}
