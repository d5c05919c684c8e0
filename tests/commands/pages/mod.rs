//! Pages with charts in a browser: of a recording and of an identification.

mod identification;
mod report;
mod widths;
