//! Certificates for tests, by the command `openssl`.

use std::path::Path;
use std::process::Command;

/// Address of the machine's host for each remote host, and over the lossy link.
const ADDRESSES: &str = "subjectAltName=IP:10.77.1.1,IP:10.77.2.1,IP:10.78.0.1,IP:127.0.0.1";

const NEW_KEY: &str = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2";

fn openssl(folder: &Path, arguments: &str) -> Result<(), String> {
    let ended = Command::new("openssl").args(arguments.split(' ')).current_dir(folder).output();
    let ended = ended.map_err(|error| format!("openssl: {error}"))?;
    if ended.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&ended.stderr).into()) }
}

/// An authority: `NAME.pem` and `NAME.key`.
pub fn authority(folder: &Path, name: &str) -> Result<(), String> {
    openssl(folder, &format!("{NEW_KEY} -subj /CN={name} -keyout {name}.key -out {name}.pem"))
}

/// A certificate for a name, signed by an authority: `FILE.pem` and `FILE.key`.
pub fn certificate(folder: &Path, authority: &str, name: &str, file: &str) -> Result<(), String> {
    let signed = format!(
        "-CA {authority}.pem -CAkey {authority}.key -addext {ADDRESSES} -addext basicConstraints=CA:FALSE"
    );
    openssl(folder, &format!("{NEW_KEY} {signed} -subj /CN={name} -keyout {file}.key -out {file}.pem"))
}
