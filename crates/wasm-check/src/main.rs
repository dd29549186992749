//! A calibration without files, threads, clock or terminal: compiled for `wasm32-unknown-unknown` by `.ci/run`, which shows that the
//! library needs none of them.

#![forbid(unsafe_code)]

use groundcal::{Error, Options, Plain, Silent, calibrate_matches, plan::PlanRequest, synthetic::PointScene};

fn main() -> Result<(), Error> {
    let scene = PointScene::nominal(0);
    let pairs = scene.pairs();
    let names: Vec<String> = (0..2 * pairs.len()).map(|i| format!("view {i}")).collect();
    let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
    let plan = PlanRequest { motions: Some(1), ..PlanRequest::default() };
    let planned = plan.report(Some(&calibration), &Plain);
    planned.map(|_| ()).map_err(|e| Error::InvalidInput(format!("no plan: {e:?}")))
}
