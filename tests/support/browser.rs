//! Chromium without a window.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

use super::not_run::lacking;
use super::python::output;

/// Names under which distributions install it.
const NAMES: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// Generous limit against hanging \[s\].
const LIMIT_S: &str = "150";

/// Attribute of the body in which a script leaves what it has found.
const RESULT: &str = "data-result=\"";

/// A browser with a profile of its own.
pub struct Browser {
    command: &'static str,
    profile: TempDir,
}

impl Browser {
    /// `None` if there is none, which the result of the tests says.
    pub fn find() -> Option<Self> {
        let is_there = |name: &&str| Command::new(name).arg("--version").output().is_ok();
        let Some(command) = NAMES.into_iter().find(is_there) else {
            lacking("Chromium; apt-get install chromium");
            return None;
        };
        Some(Self { command, profile: TempDir::new().unwrap() })
    }

    /// Opens a file with a script at its end, which sets `document.body.dataset.result` to JSON. The console must stay
    /// empty: errors and what the policy of the page refuses would be there.
    pub fn run(&self, page: &Path, script: &str) -> Value {
        self.show(&with_script(page, script))
    }

    /// The same in frames of these widths \[pixels\]; returns an array of what each has left.
    pub fn run_in_widths(&self, page: &Path, script: &str, widths: &[u32]) -> Value {
        let text = serde_json::to_string(&with_script(page, script)).unwrap().replace('<', "\\u003c");
        let frames = include_str!("frames.js");
        self.show(&format!(
            "<body><script>const PAGE = {text}, WIDTHS = {widths:?};\n{frames}</script></body>"
        ))
    }

    fn show(&self, text: &str) -> Value {
        let path = self.profile.path().join("page.html");
        fs::write(&path, text).unwrap();
        self.open(&format!("file://{}", path.display()), "--virtual-time-budget=20000")
    }

    /// Opens an address; `end` is the option that says when the page is looked at.
    pub fn open(&self, address: &str, end: &str) -> Value {
        let log = self.profile.path().join("log");
        let profile = format!("--user-data-dir={}", self.profile.path().join("profile").display());
        let mut command = Command::new("timeout");
        command.args([LIMIT_S, self.command, "--headless", "--no-sandbox", "--disable-gpu", &profile, end]);
        command.args(["--enable-logging", "--v=0", "--dump-dom", "--window-size=1280,1000", address]);
        command.arg(format!("--log-file={}", log.display())).env("CHROME_LOG_FILE", &log);
        let document = output(&mut command).unwrap();
        let logged = fs::read_to_string(&log).unwrap_or_default();
        let console: Vec<_> = logged.lines().filter(|line| line.contains("CONSOLE")).collect();
        assert!(console.is_empty(), "{console:#?}");
        let (_, rest) = document.split_once(RESULT).expect("the script has left its result");
        let (json, _) = rest.split_once('"').unwrap();
        serde_json::from_str(&json.replace("&quot;", "\"").replace("&amp;", "&")).unwrap()
    }
}

/// Text of a page with a script at its end.
fn with_script(page: &Path, script: &str) -> String {
    let text = fs::read_to_string(page).unwrap();
    let (before, after) = text.split_at(text.rfind("</body>").unwrap());
    format!("{before}<script>{script}</script>{after}")
}
