//! The repository itself, and what reads files and command lines from people: arrows between folders, documents, units of the service,
//! configuration files, arbitrary bytes, drawing of charts.

mod commands;
mod configuration;
mod deploy;
mod documents;
mod figures;
mod fuzz;
mod wall;
