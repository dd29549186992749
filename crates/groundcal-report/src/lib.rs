//! What groundcal found, for people: text for the terminal, figures as SVG and PNG, a page in HTML.

#![forbid(unsafe_code)]

pub mod canvas;
pub mod compare;
pub mod comparison;
pub mod error;
pub mod html;
pub mod number;
#[cfg(feature = "plan")]
pub mod plan;
pub mod plot;
pub mod terminal;
pub mod text;
pub mod uncertainty;
