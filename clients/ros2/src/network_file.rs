//! `NAME-network.toml`: how a machine is connected to networks.

use std::net::IpAddr;

use hexad_bridge::requests::{STOPS, requests_of_names};
use hexad_core::control::signals::state::Request;
use hexad_machine::text::excerpt::toml_error;
use nix::ifaddrs::getifaddrs;
use serde::Deserialize;
use serde::de::IgnoredAny;

/// File of one machine.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkFile {
    /// `name` of the machine file.
    pub name: String,
    /// Connection to ROS 2.
    pub ros2: Ros2Section,
    /// Connection to Zenoh, which is for another bridge.
    #[serde(default, rename = "zenoh")]
    _zenoh: IgnoredAny,
}

/// Section `[ros2]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ros2Section {
    /// Whether everything that reaches the interface is trusted.
    #[serde(default)]
    pub trusted_network: bool,
    /// Network interface over which the bridge is discovered.
    #[serde(default)]
    pub interface: String,
    /// ROS_DOMAIN_ID of the network.
    #[serde(default)]
    pub domain_id: u16,
    /// Namespace of topics and services, but not of `/tf`.
    #[serde(default = "root")]
    pub namespace: String,
    /// What comes before the names of the frames `base` and `platform`.
    #[serde(default)]
    pub frame_prefix: String,
    /// Rate of the messages to ROS 2.
    #[serde(default = "default_rate_hz")]
    pub rate_hz: f64,
    /// Setpoints that are accepted.
    #[serde(default)]
    pub setpoints: Vec<SetpointTopic>,
    /// Names of the requests that are accepted.
    #[serde(default = "stops")]
    pub requests: Vec<String>,
}

/// Topic with setpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SetpointTopic {
    /// Poses without derivatives.
    Pose,
    /// Poses with velocities and accelerations.
    Trajectory,
}

fn root() -> String {
    "/".into()
}

fn default_rate_hz() -> f64 {
    100.0
}

fn stops() -> Vec<String> {
    STOPS.map(|request| request.name().into()).into()
}

/// Largest DDS domain with all ports below the range that Linux gives to other connections.
const MAX_DOMAIN_ID: u16 = 101;

/// Largest rate of messages \[Hz\].
const MAX_RATE_HZ: f64 = 1000.0;

impl NetworkFile {
    /// Reads and checks a text; error texts name it `place`.
    pub fn parse(text: &str, place: &str) -> Result<Self, String> {
        let file: Self =
            toml::from_str(text).map_err(|error| format!("{place}: {}", toml_error(text, &error)))?;
        file.ros2.check().map_err(|error| format!("{place}: ros2.{error}"))?;
        Ok(file)
    }
}

impl Ros2Section {
    fn check(&self) -> Result<(), String> {
        if !self.trusted_network {
            return Err("trusted_network = false: DDS has no identity of sources. Every program that reaches the interface can move \
                        the platform, stop it, and read everything. Set it to true only for a network of its own, without other \
                        programs"
                .into());
        }
        if self.interface.is_empty() {
            return Err("interface: is missing; name the interface of the trusted network, as enp3s0, or lo for this host alone".into());
        }
        if self.domain_id > MAX_DOMAIN_ID {
            return Err(format!("domain_id = {}: must be at most {MAX_DOMAIN_ID}", self.domain_id));
        }
        if !(1.0..=MAX_RATE_HZ).contains(&self.rate_hz) {
            return Err(format!("rate_hz = {}: must be in [1, {MAX_RATE_HZ}]", self.rate_hz));
        }
        let is_word = |word: &str| {
            word.starts_with(|c: char| c.is_ascii_alphabetic())
                && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        };
        let words = self.namespace.strip_prefix('/');
        if !words.is_some_and(|words| words.is_empty() || words.split('/').all(is_word)) {
            return Err(format!(
                "namespace = \"{}\": must be a name of ROS 2, as /cell/base",
                self.namespace
            ));
        }
        self.allowed_requests().map(drop)
    }

    /// The requests that are accepted.
    pub fn allowed_requests(&self) -> Result<Vec<Request>, String> {
        requests_of_names(&self.requests)
    }

    /// IPv4 addresses of the interface.
    pub fn addresses(&self) -> Result<Vec<IpAddr>, String> {
        let interfaces = getifaddrs().map_err(|error| format!("interfaces: {error}"))?;
        let of_name = interfaces.filter(|found| found.interface_name == self.interface);
        let ipv4 = of_name.filter_map(|found| Some(found.address?.as_sockaddr_in()?.ip().into()));
        let addresses: Vec<IpAddr> = ipv4.collect();
        if addresses.is_empty() {
            return Err(format!("interface {}: does not exist, or has no IPv4 address", self.interface));
        }
        Ok(addresses)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUSTED: &str = "name = \"m\"\n[ros2]\ntrusted_network = true\ninterface = \"lo\"\n";

    #[test]
    fn nothing_but_stops_is_accepted_by_default() {
        let beside = format!("{TRUSTED}[zenoh]\nlisten = []\n");
        let section = NetworkFile::parse(&beside, "m-network.toml").unwrap().ros2;
        assert_eq!(section.allowed_requests().unwrap(), STOPS);
        assert!(section.setpoints.is_empty());
        assert!(section.addresses().unwrap().iter().all(IpAddr::is_loopback));
    }

    #[test]
    fn errors_name_place_value_and_remedy() {
        for (text, words) in [
            (
                "name = \"m\"\n[ros2]\n",
                "m-network.toml: ros2.trusted_network = false: DDS has no identity of sources",
            ),
            ("name = \"m\"\n[ros2]\ntrusted_network = true\n", "ros2.interface: is missing"),
            (&format!("{TRUSTED}domain_id = 102\n"), "ros2.domain_id = 102: must be at most 101"),
            (&format!("{TRUSTED}rate_hz = nan\n"), "ros2.rate_hz = NaN"),
            (&format!("{TRUSTED}namespace = \"/a-b\"\n"), "ros2.namespace = \"/a-b\""),
            (&format!("{TRUSTED}requests = [\"go\"]\n"), "ros2.requests: \"go\" must be one of engage"),
            (&format!("{TRUSTED}setpoints = [\"twist\"]\n"), "unknown variant `twist`"),
            (&format!("{TRUSTED}[zigbee]\n"), "unknown field `zigbee`"),
        ] {
            let error = NetworkFile::parse(text, "m-network.toml").unwrap_err();
            assert!(error.contains(words), "{error}");
        }
    }
}
