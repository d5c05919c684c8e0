//! Figures of a run as CSV files, and the charts that are drawn from them.

use std::fs;
use std::path::{Path, PathBuf};

use hexad::text::files::write_whole;
use serde::de::DeserializeOwned;

use super::{Failure, provenance};

/// Folder of the CSV files and charts of a run.
pub struct Charts {
    folder: PathBuf,
}

impl Charts {
    /// `benches/charts`, what the documents show.
    pub fn published() -> Self {
        Self { folder: Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/charts") }
    }

    /// The published charts; for a quick run, whose figures mean little, a folder in `target`.
    pub fn of_run(is_quick: bool) -> Self {
        if is_quick {
            println!("a quick run: its figures mean little");
            return Self { folder: Path::new(env!("CARGO_TARGET_TMPDIR")).join("charts") };
        }
        Self::published()
    }

    /// Path of a file.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Writes a CSV file; its first line is a comment, the provenance.
    pub fn write_csv<R>(
        &self,
        name: &str,
        header: &[&str],
        rows: impl IntoIterator<Item = R>,
    ) -> Result<(), Failure>
    where
        R: IntoIterator<Item: AsRef<[u8]>>,
    {
        let mut csv = csv::Writer::from_writer(format!("# {}\n", provenance()).into_bytes());
        csv.write_record(header)?;
        for row in rows {
            csv.write_record(row)?;
        }
        let path = self.path(name);
        fs::create_dir_all(&self.folder)?;
        write_whole(&path, &csv.into_inner()?)?;
        println!("written: {}", path.display());
        Ok(())
    }

    /// Rows of a CSV file; fields are found by the names of their columns.
    pub fn read<T: DeserializeOwned>(&self, name: &str) -> Result<Figures<T>, Failure> {
        let text = fs::read_to_string(self.path(name)).map_err(|error| format!("{name}: {error}"))?;
        let provenance = text.lines().next().and_then(|line| line.strip_prefix("# ")).map(String::from);
        let mut csv = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
        Ok(Figures { provenance, rows: csv.deserialize().collect::<Result<_, _>>()? })
    }
}

/// Figures of a run, read back from their file.
pub struct Figures<T> {
    provenance: Option<String>,
    pub rows: Vec<T>,
}

impl<T> Figures<T> {
    /// A title with the provenance as its subtitle.
    pub fn titled(&self, title: &str) -> String {
        let lines: Vec<_> = [title].into_iter().chain(self.provenance.as_deref()).collect();
        lines.join("\n")
    }
}
