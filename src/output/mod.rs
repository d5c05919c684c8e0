//! Pictures and pages: charts as SVG files, self-contained pages for a browser.

pub mod axis;
pub mod charts;
pub mod page;
pub mod svg;
