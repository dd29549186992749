//! Capture advice: which motions to make, and how well the camera will be known from them.
//!
//! [`PlanRequest`] asks in the words of a person ("a tripod, f about 900 px") and gives a [`PlanReport`].

pub(crate) mod after;
mod candidate;
pub(crate) mod carriers;
mod information;
mod planner;
pub(crate) mod report;
pub(crate) mod request;
mod search;

pub use carriers::{Carrier, CarrierMotion};
pub use planner::{PlannedMotion, Prediction, VarianceShares};
pub use report::{Assumptions, PlanReport};
pub use request::{PlanRequest, RequestError};

#[cfg(test)]
mod tests;
