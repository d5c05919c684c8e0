//! Numbers, tables and files as people and other programs read and write them.

pub mod coordinate_rows;
mod csv_columns;
mod csv_groups;
pub mod csv_rows;
pub mod csv_table;
pub mod csv_writer;
pub mod excerpt;
pub mod files;
pub mod nearest;
pub mod numbers;
pub mod text_table;
pub mod units;
