//! Configuration of the Zenoh session of a bridge: mutual TLS, and the list of what each certificate may do.
//!
//! Everything is denied but what the list permits. Keys that write contain the name of the certificate, so that the key of a
//! message is the identity of its sender.

use serde_json::{Value, json};
use zenoh::Config;

use crate::network_file::{Client, Identity, NetworkFile, listening_endpoint};

/// Silence after which a side counts as lost \[ms\].
const LEASE_MS: u64 = 2_000;

/// Largest message that is put together from parts \[bytes\]: many times the largest one of the bridge.
const MAX_MESSAGE_BYTES: u64 = 1 << 16;

/// Key on which a client publishes setpoints.
pub fn setpoint_key(machine: &str, client: &str) -> String {
    format!("hexad/{machine}/setpoint/{client}")
}

/// Key of a client's requests of one name.
pub fn request_key(machine: &str, client: &str, request: &str) -> String {
    format!("hexad/{machine}/request/{client}/{request}")
}

/// Key of the token that shows that a session of a client is alive.
pub fn session_token(machine: &str, client: &str, session: &str) -> String {
    format!("hexad/{machine}/client/{client}/{session}")
}

/// Configuration of the session that listens.
pub fn bridge_config(file: &NetworkFile) -> Result<Config, String> {
    let section = &file.zenoh;
    let endpoints: Vec<_> = section.listen.iter().map(|endpoint| listening_endpoint(endpoint)).collect();
    let mut root = json!({
        "mode": "router",
        "listen": { "endpoints": endpoints },
        "access_control": access_control(file),
    });
    link(&mut root, &section.identity, "listen");
    config(&root)
}

/// Configuration of a session with one bridge.
pub fn client_config(endpoint: &str, identity: &Identity, timeout_ms: u64) -> Result<Config, String> {
    let mut root = json!({
        "mode": "client",
        "connect": { "endpoints": [endpoint], "timeout_ms": timeout_ms, "exit_on_failure": true },
    });
    link(&mut root, identity, "connect");
    config(&root)
}

fn config(root: &Value) -> Result<Config, String> {
    Config::from_json5(&root.to_string()).map_err(|error| error.to_string())
}

/// Adds what both sides have in common.
fn link(root: &mut Value, identity: &Identity, side: &str) {
    root["scouting"] = json!({ "multicast": { "enabled": false }, "gossip": { "enabled": false } });
    root["transport"] = json!({ "link": {
        "protocols": ["quic", "tls"],
        "tx": { "lease": LEASE_MS },
        "rx": { "max_message_size": MAX_MESSAGE_BYTES },
        "tls": {
            "root_ca_certificate": identity.ca,
            format!("{side}_certificate"): identity.certificate,
            format!("{side}_private_key"): identity.key,
            "enable_mtls": true,
            "close_link_on_expiration": true,
        },
    } });
}

/// The access list.
fn access_control(file: &NetworkFile) -> Value {
    let machine = format!("hexad/{}", file.name);
    let below = format!("{machine}/**");
    let declarations = ["declare_subscriber", "declare_queryable", "declare_liveliness_subscriber"];
    let subscriptions = ["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"];
    let mut rules = vec![
        rule("read", "egress", &["put", "reply", "liveliness_token"], &[machine, below.clone()]),
        rule("find", "egress", &declarations, &[below]),
        rule("subscribe", "ingress", &subscriptions, &["hexad/**".into()]),
    ];
    let (mut subjects, mut policies) = (vec![], vec![]);
    for (name, client) in &file.zenoh.client {
        let own = own_rules(&file.name, name, client);
        let mut of_client =
            vec!["read", "find", "subscribe"].into_iter().map(Value::from).collect::<Vec<_>>();
        of_client.extend(own.iter().map(|rule| rule["id"].clone()));
        rules.extend(own);
        subjects.push(json!({ "id": name, "cert_common_names": [name] }));
        policies.push(json!({ "rules": of_client, "subjects": [name] }));
    }
    json!({ "enabled": true, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies })
}

/// What a client may send.
fn own_rules(machine: &str, name: &str, client: &Client) -> Vec<Value> {
    let requests = client.allowed_requests().unwrap_or_default();
    let mut names: Vec<_> = requests.iter().map(|request| request.name()).chain(["status"]).collect();
    if client.motions {
        names.extend(crate::motions::REQUESTS);
    }
    let keys: Vec<_> = names.iter().map(|request| request_key(machine, name, request)).collect();
    let tokens = session_token(machine, name, "*");
    let mut rules = vec![
        rule(&format!("request {name}"), "ingress", &["query"], &keys),
        rule(&format!("token {name}"), "ingress", &["liveliness_token"], &[tokens]),
    ];
    if client.setpoints {
        let id = format!("setpoint {name}");
        rules.push(rule(&id, "ingress", &["put"], &[setpoint_key(machine, name)]));
    }
    rules
}

fn rule(id: &str, flow: &str, messages: &[&str], keys: &[String]) -> Value {
    json!({ "id": id, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys })
}
