//! Rebuilds the crate when a shader file is added or removed: the embedding macro only tracks the
//! files that it has already seen.

fn main() {
    println!("cargo::rerun-if-changed=shaders");
}
