//! What is written for people and other programs: charts, CSV tables, files.

pub mod axis;
pub mod charts;
pub mod csv_rows;
pub mod csv_table;
pub mod excerpt;
pub mod files;
pub mod machine_drawing;
pub mod numbers;
pub mod svg;
