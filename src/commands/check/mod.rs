//! `hexad check`: whether a machine can be run with its file, and numbers of the machine at home that an
//! engineer can compare with the drawing.

use std::path::PathBuf;

pub use self::report::CheckReport;
use crate::commands::arguments::{CONE_HELP, MachineFile, cone};
use crate::commands::failure::Failure;
use hexad_machine::text::files::{print, print_json};

mod drawing;
mod limits;
mod report;
mod text;

#[derive(Debug, clap::Args)]
pub struct CheckArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Draw the machine at home (SVG): from above, from the side, in perspective, with numbered joints
    #[arg(long, value_name = "FILE")]
    drawing: Option<PathBuf>,
    #[arg(long, help = CONE_HELP, value_name = "ANGLE", value_parser = cone, allow_hyphen_values = true)]
    gravity_cone: Option<f64>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

impl CheckArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let config = self.machine.load()?;
        let examination = config.examine_in_cone(self.gravity_cone);
        let report = CheckReport::new(&config, &examination);
        // The numbers first: they are useful even if no file can be written.
        if self.json {
            print_json(&report)?
        } else {
            print(&report)?
        }
        if let Some(path) = self.drawing {
            drawing::write_svg(&path, &config.name, &config.machine)?;
            if !self.json {
                print(format_args!("drawing of the machine at home: {}\n", path.display()))?;
            }
        }
        examination.into_result(&config)?;
        Ok(())
    }
}
