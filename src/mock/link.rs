//! Links the shared library so that it is never unmapped: loaders unload runtimes, while threads that have called one
//! still have Rust's thread-exit hooks to run, which are code of the library.

fn main() {
    println!("cargo::rerun-if-changed=src/mock/link.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-z,nodelete");
    }
}
