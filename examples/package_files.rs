//! Writes the manual pages and the completions of the Debian package, from the definition of the command line:
//! `cargo run --example package_files -- FOLDER`.

use std::path::PathBuf;
use std::{env, fs, io};

use clap::CommandFactory;
use clap_complete::{Shell, generate_to};
use hexad::commands::CommandLine;

fn main() -> io::Result<()> {
    let folder = PathBuf::from(env::args_os().nth(1).unwrap_or_else(|| "target/package".into()));
    let [manual, completions] = ["man", "completions"].map(|name| folder.join(name));
    for folder in [&manual, &completions] {
        fs::create_dir_all(folder)?;
    }
    clap_mangen::generate_to(CommandLine::command(), &manual)?;
    for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
        generate_to(shell, &mut CommandLine::command(), "hexad", &completions)?;
    }
    Ok(())
}
