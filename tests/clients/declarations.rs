//! What C and Python include is what `hexad messages` prints, and what cbindgen makes of the source of libhexad.

use std::fs;

use crate::common::libhexad::{declared, repository};
use crate::file;

#[test]
fn the_declarations_are_those_of_the_messages() {
    for (language, path) in
        [("c", "clients/c/include/hexad_messages.h"), ("python", "clients/python/src/hexad/messages.py")]
    {
        let committed = fs::read_to_string(repository().join(path)).unwrap();
        assert!(committed == declared(language), "run: hexad messages --language {language} > {path}");
    }
}

#[test]
fn the_header_is_that_of_the_source() {
    let folder = repository().join("clients/c");
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::Builder::new().with_crate(&folder).with_config(config).generate().unwrap();
    let mut made = vec![];
    bindings.write(&mut made);
    let made = String::from_utf8(made).unwrap();
    let committed = fs::read_to_string(folder.join("include/hexad.h")).unwrap_or_default();
    if made != committed {
        let path = file("hexad.h");
        fs::write(&path, &made).unwrap();
        panic!("the source has changed: cp {} clients/c/include/hexad.h", path.display());
    }
    assert!(made.matches("(").count() > 12, "{made}");
}
