//! `include/hexad.h` is what cbindgen makes of the source.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed assertion is how a test speaks")]

use std::fs;
use std::path::Path;

#[test]
fn the_header_is_that_of_the_source() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::Builder::new().with_crate(folder).with_config(config).generate().unwrap();
    let mut made = vec![];
    bindings.write(&mut made);
    let made = String::from_utf8(made).unwrap();
    let committed = fs::read_to_string(folder.join("include/hexad.h")).unwrap_or_default();
    if made != committed {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hexad.h");
        fs::write(&path, &made).unwrap();
        panic!("the source has changed: cp {} clients/c/include/hexad.h", path.display());
    }
    assert!(made.matches("(").count() > 12, "{made}");
}
