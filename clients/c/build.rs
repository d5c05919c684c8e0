//! How the shared library is linked.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // The name under which programs load it: the number changes with every change of the ABI that breaks them.
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libhexad.so.0");
    // What the dependencies define for themselves, such as `ftruncate` (src/client/messages/reservation.rs), must not replace functions
    // of the program, nor be replaced.
    println!("cargo:rustc-cdylib-link-arg=-Wl,--exclude-libs,ALL");
}
