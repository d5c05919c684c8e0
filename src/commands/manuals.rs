//! `hexad manuals`: manual pages and completions of shells, from the definition of the command line. The package has the same.

use std::fs;
use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_complete::{Shell, generate_to};

use super::CommandLine;
use super::failure::Failure;
use hexad_machine::text::files::{FileError, print};

#[derive(Debug, Args)]
pub struct ManualsArguments {
    /// Folder, in which `man` and `completions` are made
    folder: PathBuf,
}

impl ManualsArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let [manual, completions] = ["man", "completions"].map(|name| self.folder.join(name));
        for folder in [&manual, &completions] {
            fs::create_dir_all(folder).map_err(FileError::on(folder))?;
        }
        clap_mangen::generate_to(CommandLine::command(), &manual).map_err(FileError::on(&manual))?;
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            generate_to(shell, &mut CommandLine::command(), "hexad", &completions)
                .map_err(FileError::on(&completions))?;
        }
        Ok(print(format_args!("{}\n{}\n", manual.display(), completions.display()))?)
    }
}
