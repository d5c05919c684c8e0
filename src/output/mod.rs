//! Everything written for people and other programs: charts, tables, CSV and JSON files.

pub mod axis;
pub mod charts;
pub mod coordinate_rows;
mod csv_columns;
mod csv_groups;
pub mod csv_rows;
pub mod csv_table;
pub mod csv_writer;
pub mod excerpt;
pub mod files;
pub mod numbers;
pub mod page;
pub mod svg;
pub mod text_table;
pub mod units;
pub mod version;
