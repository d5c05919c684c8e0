//! A page with charts: one HTML file that requests nothing and opens from disk.
//!
//! Its head is JSON, its samples are numbers of four bytes in base64, its parts are the files beside this one. The charts are
//! drawn by [uPlot](https://github.com/leeoniya/uPlot) 1.6.32 (MIT), which is part of the page with its licence.

/// Policy of a page without a server: it may run and style itself, and load nothing.
const POLICY: &str =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:";

/// Policy of a page that its server feeds: it may also request data from that server.
const LIVE_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; connect-src 'self'";

/// The page, with a mark `{{name}}` where each part belongs.
const FRAME: &str = include_str!("page.html");
const LICENSE: &str = include_str!("uplot/LICENSE");
const STYLES: [&str; 2] = [include_str!("uplot/uPlot.min.css"), include_str!("page.css")];

/// Scripts of all pages in the order in which they run.
const LIBRARY: &str = include_str!("uplot/uPlot.iife.min.js");
const DATA: &str = include_str!("data.js");
const AXIS: &str = include_str!("axis.js");
const CHARTS: &str = include_str!("charts.js");
const PAGE: &str = include_str!("page.js");

/// Kind of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PageKind {
    /// A recorded run.
    Recording,
    /// A run that a server feeds.
    Live,
    /// An identification.
    Identification,
    /// A calibration.
    Calibration,
}

impl PageKind {
    fn policy(self) -> &'static str {
        if self == Self::Live { LIVE_POLICY } else { POLICY }
    }

    fn body(self) -> &'static str {
        match self {
            Self::Recording | Self::Live => include_str!("run.html"),
            Self::Identification => include_str!("identification.html"),
            Self::Calibration => include_str!("calibration.html"),
        }
    }

    fn scripts(self) -> &'static [&'static str] {
        match self {
            Self::Recording | Self::Live => &[
                LIBRARY,
                DATA,
                AXIS,
                include_str!("figures.js"),
                CHARTS,
                include_str!("tracks.js"),
                include_str!("scene.js"),
                include_str!("live.js"),
                PAGE,
                include_str!("run.js"),
            ],
            Self::Identification => &[LIBRARY, DATA, AXIS, CHARTS, PAGE, include_str!("identification.js")],
            Self::Calibration => &[LIBRARY, DATA, AXIS, CHARTS, PAGE, include_str!("calibration.js")],
        }
    }
}

/// Assembles a page. `summary` is plain text, which its scripts replace, `head` is JSON, `samples` are the bytes of numbers.
pub fn page(kind: PageKind, title: &str, summary: &str, head: &str, samples: &[u8]) -> String {
    let mut text = String::with_capacity(samples.len() / 3 * 4 + head.len() + 500_000);
    for part in FRAME.split("{{") {
        let (name, rest) = part.split_once("}}").unwrap_or(("", part));
        match name {
            "title" => text.push_str(&escaped(title)),
            "summary" => text.push_str(&escaped(summary)),
            "policy" => text.push_str(kind.policy()),
            "license" => text.push_str(LICENSE),
            "body" => text.push_str(kind.body()),
            "styles" => STYLES.iter().for_each(|style| text.push_str(style)),
            "scripts" => kind.scripts().iter().for_each(|script| text.push_str(script)),
            // So that nothing in it ends the element.
            "head" => text.push_str(&head.replace('<', "\\u003c")),
            "samples" => append_base64(&mut text, samples),
            _ => {}
        }
        text.push_str(rest);
    }
    text
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// Appends bytes as base64 (RFC 4648), padded.
pub fn append_base64(text: &mut String, bytes: &[u8]) {
    for group in bytes.chunks(3) {
        let byte = |k: usize| u32::from(group.get(k).copied().unwrap_or(0));
        let number = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            let place = (number >> (18 - 6 * digit) & 63) as usize;
            let character = DIGITS.get(place).filter(|_| digit as usize <= group.len());
            text.push(char::from(*character.unwrap_or(&b'=')));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_rfc_4648() {
        for (bytes, expected) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ] {
            let mut text = String::new();
            append_base64(&mut text, bytes.as_bytes());
            assert_eq!(text, expected);
        }
        let mut text = String::new();
        append_base64(&mut text, &[0xfb, 0xff, 0xbf]);
        assert_eq!(text, "+/+/");
    }

    #[test]
    fn a_page_is_one_document_that_no_text_can_leave() {
        let head = "{\"text\":\"</script><script>alert(1)\"}";
        for kind in [PageKind::Recording, PageKind::Live, PageKind::Identification, PageKind::Calibration] {
            let text = page(kind, "a < b & c", "1 < 2 & 3", head, b"foo");
            assert!(text.contains("<pre id=\"summary\">1 &lt; 2 &amp; 3</pre>"));
            assert!(text.contains("<title>a &lt; b &amp; c</title>") && text.contains(">Zm9v</script>"));
            assert!(!text.contains("alert(1)</script>") && !text.contains("</script><script>alert"));
            assert_eq!(text.contains("connect-src 'self'"), kind == PageKind::Live);
            assert_eq!(text.matches("{{").count(), kind.scripts().concat().matches("{{").count());
            for address in ["src=\"http", "href=\"http", "url(http", "@import"] {
                assert!(!text.contains(address), "{address}");
            }
            assert!(text.contains("Permission is hereby granted"));
        }
    }
}
