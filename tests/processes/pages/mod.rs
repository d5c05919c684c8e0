//! Pages with charts in a browser: of a recording, and live.

mod browser;
mod report;
mod view;
