//! The repository itself, and what reads files from people: arrows between folders, documents, units of the service,
//! configuration files, arbitrary bytes, drawing of charts.

mod common;

mod configuration;
mod deploy;
mod documents;
mod figures;
mod fuzz;
mod wall;
