//! Progress bars: drawn on a terminal, and nowhere else.

use indicatif::{ProgressBar, ProgressStyle};

/// Bar that counts items, such as rows.
pub fn item_bar(count: usize, items: &str) -> ProgressBar {
    bar(count as u64, &format!("{{bar:40}} {{human_pos}} of {{human_len}} {items}, {{eta}} left"))
}

/// Bar that advances by milliseconds over a duration.
pub fn millisecond_bar(seconds: f64) -> ProgressBar {
    bar((seconds * 1e3) as u64, "{bar:40} {elapsed} {msg}")
}

fn bar(length: u64, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style)
}
