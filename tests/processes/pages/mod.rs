//! Pages with charts in a browser: of a recording, of an identification, and live.

mod browser;
mod identification;
mod report;
mod view;
mod widths;
