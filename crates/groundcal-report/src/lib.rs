//! What groundcal found, for people: text for the terminal, figures as SVG and PNG, a page in HTML.

#![allow(missing_docs)]

pub mod error;
pub mod html;
pub mod plot;
pub mod text;
