//! What C and Python include is what `hexad messages` prints.

use std::fs;

use hexad_support::libhexad::declared;
use hexad_support::repository;

#[test]
fn the_declarations_are_those_of_the_messages() {
    for (language, path) in
        [("c", "clients/c/include/hexad_messages.h"), ("python", "clients/python/src/hexad/messages.py")]
    {
        let committed = fs::read_to_string(repository().join(path)).unwrap();
        assert!(committed == declared(language), "run: hexad messages --language {language} > {path}");
    }
}
