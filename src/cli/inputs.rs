//! `--set` and `--inputs`: values that come from outside, all checked before the first scan.

use std::path::Path;

use khz_machine::image::Image;
use khz_machine::variables::VariableTable;
use kilohertz::files;
pub use kilohertz::inputs::CsvInputs;
use kilohertz::traces::MAX_TABLE_BYTES;

use super::output::Failure;

/// Applies each `NAME=VALUE` to the image.
pub fn set_values(names: &VariableTable, image: &mut Image, settings: &[String]) -> Result<(), Failure> {
    for setting in settings {
        let (name, value) =
            setting.split_once('=').ok_or_else(|| Failure::usage(format!("--set {setting}: NAME=VALUE is wanted")))?;
        let variable =
            names.resolve(name.trim()).map_err(|error| Failure::refused(format!("--set {setting}: {error}")))?;
        names
            .write(image, &variable, value.trim())
            .map_err(|error| Failure::refused(format!("--set {setting}: {error}")))?;
    }
    Ok(())
}

/// Reads and checks a whole `--inputs` file.
pub fn read_csv(path: &Path, names: &VariableTable, image: &Image) -> Result<CsvInputs, Failure> {
    let bytes = files::read_limited(path, MAX_TABLE_BYTES)?;
    CsvInputs::parse(&path.display().to_string(), &bytes, names, image).map_err(Failure::refused)
}
