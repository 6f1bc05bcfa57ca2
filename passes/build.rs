//! Tells the crate how far it is optimised: times are of what it does.

fn main() {
    println!("cargo:rustc-env=CURITIBA_PASSES_OPT_LEVEL={}", std::env::var("OPT_LEVEL").unwrap_or_default());
    println!("cargo:rerun-if-changed=build.rs");
}
