//! `NAME-network.toml`: how a machine is connected to Zenoh, and which certificates may do what.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use hexad_bridge::requests::{STOPS, requests_of_names};
use hexad_core::control::signals::state::Request;
use hexad_machine::text::excerpt::toml_error;
use serde::Deserialize;
use serde::de::IgnoredAny;

/// File of one machine.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkFile {
    /// `name` of the machine file.
    pub name: String,
    /// Connection to Zenoh.
    pub zenoh: ZenohSection,
    /// Connection to ROS 2, which is for another bridge.
    #[serde(default, rename = "ros2")]
    _ros2: IgnoredAny,
}

/// Section `[zenoh]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZenohSection {
    /// Endpoints at which the bridge listens.
    #[serde(default)]
    pub listen: Vec<String>,
    /// Certificate and key of this host.
    pub identity: Identity,
    /// Rate of the status messages.
    #[serde(default = "default_status_hz")]
    pub status_hz: f64,
    /// Rate of the poses.
    #[serde(default = "default_pose_hz")]
    pub pose_hz: f64,
    /// Rate of the measurements.
    #[serde(default)]
    pub measured_hz: f64,
    /// Rate of the forces.
    #[serde(default)]
    pub force_hz: f64,
    /// The remote sides that are admitted, by the common names of their certificates.
    #[serde(default)]
    pub client: BTreeMap<String, Client>,
}

/// Files of PEM for mutual TLS, relative to the file that names them.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Certificate of the authority that has signed all others.
    pub ca: PathBuf,
    /// Certificate of this side.
    pub certificate: PathBuf,
    /// Key of that certificate.
    pub key: PathBuf,
}

/// A remote side. Each reads everything, and may stop.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Client {
    /// Whether its setpoints are accepted.
    pub setpoints: bool,
    /// Whether its requests `goto`, `hold` and `jog` are accepted.
    pub motions: bool,
    /// Names of further requests that are accepted.
    pub requests: Vec<String>,
}

fn default_status_hz() -> f64 {
    20.0
}

fn default_pose_hz() -> f64 {
    100.0
}

/// Largest rate of messages \[Hz\].
const MAX_RATE_HZ: f64 = 1000.0;

/// What an endpoint over QUIC needs, so that samples are datagrams and nothing waits for a lost one.
const DATAGRAMS: &str = "?mixed_rel=1";

/// One stream for all priorities: of several, one may deliver a request before another has delivered the declaration of its key, and Zenoh
/// then ends the request without an answer.
const ONE_STREAM: &str = ";multistream=0";

impl NetworkFile {
    /// Reads and checks a text; error texts name it `place`.
    pub fn parse(text: &str, place: &Path) -> Result<Self, String> {
        let name = place.display();
        let mut file: Self =
            toml::from_str(text).map_err(|error| format!("{name}: {}", toml_error(text, &error)))?;
        let section = &mut file.zenoh;
        let checked = section.check().and_then(|()| section.identity.resolve(place));
        checked.map_err(|error| format!("{name}: zenoh.{error}"))?;
        Ok(file)
    }
}

impl ZenohSection {
    fn check(&self) -> Result<(), String> {
        if self.listen.is_empty() {
            return Err("listen: is missing; name an address of this host, as [\"quic/10.0.0.1:7447?mixed_rel=1\"], or tls/ \
                        on links that lose nothing"
                .into());
        }
        for endpoint in &self.listen {
            check_endpoint(endpoint).map_err(|error| format!("listen: {error}"))?;
        }
        let rates = [self.status_hz, self.pose_hz, self.measured_hz, self.force_hz];
        for (name, rate_hz) in ["status", "pose", "measured", "force"].into_iter().zip(rates) {
            if rate_hz != 0.0 && !(1.0..=MAX_RATE_HZ).contains(&rate_hz) {
                return Err(format!("{name}_hz = {rate_hz}: must be 0, or in [1, {MAX_RATE_HZ}]"));
            }
        }
        for (name, client) in &self.client {
            check_name(name).map_err(|error| format!("client.{error}"))?;
            client.allowed_requests().map_err(|error| format!("client.{name}.{error}"))?;
        }
        Ok(())
    }
}

/// Checks an endpoint of a bridge.
pub fn check_endpoint(endpoint: &str) -> Result<(), String> {
    match endpoint.split_once('/') {
        Some(("quic", address)) if !address.contains(DATAGRAMS) => Err(format!(
            "\"{endpoint}\" must end with {DATAGRAMS}: otherwise all messages wait for a lost one"
        )),
        Some((_, address)) if address.contains("multistream") => Err(format!(
            "\"{endpoint}\" must not set multistream: a bridge has one stream, so that requests stay in order"
        )),
        Some(("quic" | "tls", _)) => Ok(()),
        _ => Err(format!("\"{endpoint}\" must begin with quic/ or tls/: other links carry no certificates")),
    }
}

/// The endpoint at which a session listens.
pub fn listening_endpoint(endpoint: &str) -> String {
    endpoint.replace(DATAGRAMS, &format!("{DATAGRAMS}{ONE_STREAM}"))
}

/// Checks a name that is a part of keys.
pub fn check_name(name: &str) -> Result<(), String> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    if !name.is_empty() && name.chars().all(is_plain) {
        return Ok(());
    }
    Err(format!("\"{name}\": a name must consist of letters, digits, '_', '-' and '.'"))
}

impl Client {
    /// The requests that are accepted: all stops, and those of the list.
    pub fn allowed_requests(&self) -> Result<Vec<Request>, String> {
        let mut allowed = requests_of_names(&self.requests)?;
        allowed.extend(STOPS);
        allowed.sort_by_key(|request| request.name());
        allowed.dedup();
        Ok(allowed)
    }
}

impl Identity {
    /// Makes the paths relative to the folder of a file, and opens each once.
    pub fn resolve(&mut self, file: &Path) -> Result<(), String> {
        let folder = file.parent().unwrap_or(Path::new(""));
        for (name, path) in
            [("ca", &mut self.ca), ("certificate", &mut self.certificate), ("key", &mut self.key)]
        {
            *path = folder.join(&path);
            File::open(&path)
                .map_err(|error| format!("identity.{name} = \"{}\": {error}", path.display()))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with all keys of the list, of which each test replaces or adds one.
    fn parse(listen: &str, rest: &str) -> Result<NetworkFile, String> {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("m-network.toml");
        let text = format!(
            "name = \"m\"\n[zenoh]\nlisten = {listen}\n{rest}\n[zenoh.identity]\nca = \"Cargo.toml\"\ncertificate = \
             \"Cargo.toml\"\nkey = \"Cargo.toml\"\n"
        );
        NetworkFile::parse(&text, &file)
    }

    const LISTEN: &str = "[\"quic/127.0.0.1:7447?mixed_rel=1\", \"tls/127.0.0.1:7447\"]";

    #[test]
    fn nobody_is_admitted_by_default_and_a_client_may_only_read_and_stop() {
        assert!(parse(LISTEN, "").unwrap().zenoh.client.is_empty());
        let file = parse(LISTEN, "[zenoh.client.panel]\n[ros2]\ninterface = \"lo\"").unwrap();
        let panel = &file.zenoh.client["panel"];
        assert!(!panel.setpoints && !panel.motions);
        assert_eq!(panel.allowed_requests().unwrap(), [Request::Estop, Request::Off, Request::Stop]);
        assert!(file.zenoh.identity.ca.is_absolute());
    }

    #[test]
    fn errors_name_place_value_and_remedy() {
        for (listen, rest, words) in [
            ("[]", "", "m-network.toml: zenoh.listen: is missing"),
            ("[\"tcp/10.0.0.1:7447\"]", "", "\"tcp/10.0.0.1:7447\" must begin with quic/ or tls/"),
            ("[\"quic/10.0.0.1:7447#mixed_rel=1\"]", "", "must end with ?mixed_rel=1"),
            ("[\"quic/10.0.0.1:7447?mixed_rel=1;multistream=1\"]", "", "must not set multistream"),
            (LISTEN, "pose_hz = nan", "zenoh.pose_hz = NaN"),
            (LISTEN, "[zenoh.client.\"a/*\"]", "zenoh.client.\"a/*\": a name must consist of"),
            (
                LISTEN,
                "[zenoh.client.a]\nrequests = [\"go\"]",
                "zenoh.client.a.requests: \"go\" must be one of engage",
            ),
            (LISTEN, "[zenoh.client.a]\npoint = true", "unknown field `point`"),
            (LISTEN, "[zigbee]", "unknown field `zigbee`"),
        ] {
            let error = parse(listen, rest).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
        let absent = "name = \"m\"\n[zenoh]\nlisten = [\"tls/h:1\"]\nidentity.ca = \"no.pem\"\nidentity.certificate = \"\"\nidentity.key = \"\"\n";
        let error = NetworkFile::parse(absent, Path::new("m-network.toml")).unwrap_err();
        assert!(error.contains("zenoh.identity.ca = \"no.pem\": No such file"), "{error}");
    }
}
