//! What groundcal found, for people: text for the terminal, figures as SVG and PNG, a page in HTML.

pub mod canvas;
pub mod error;
pub mod html;
pub mod number;
pub mod plot;
pub mod text;
