//! Reading calibrations back.

pub mod groundcal_json;
