use super::Failure;
use super::results::Row;
use std::path::Path;
pub fn write(_path: &Path, _rows: &[Row]) -> Result<(), Failure> {
    Ok(())
}
